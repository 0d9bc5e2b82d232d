"""What people really bring, made synthetic: in a few lines each, run as a user would, judged by the truth."""
