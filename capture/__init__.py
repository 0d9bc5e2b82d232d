"""Sensors, recordings, calibration, point clouds: everything that knows nothing of anatomy."""
