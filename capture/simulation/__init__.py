"""What depth sensors would have recorded of a moving mesh."""
