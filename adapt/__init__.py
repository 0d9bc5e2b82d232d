"""The adaptable anatomy model and its fitting to one subject."""
