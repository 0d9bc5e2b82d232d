"""What people really bring, made synthetic: each situation in a few lines, run as a user would, and judged by the truth."""
