"""Marker trials of a laboratory beside a motion: read, brought into its frame and clock, and compared."""
