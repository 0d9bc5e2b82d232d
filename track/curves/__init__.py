"""Curves that people use: smoothed angles, speeds, events and cycles of motions, and what differs between them."""
