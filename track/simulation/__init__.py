"""Performances of a subject as depth sensors would have recorded them, with their truth."""
