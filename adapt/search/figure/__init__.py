"""Who is in a depth image and where the limbs are, by a small network of our own: a first guess, from depth alone."""
