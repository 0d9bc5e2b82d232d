"""Situations that people really bring, made synthetic in a few lines each, and how each of them is judged."""
