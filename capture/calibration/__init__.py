"""Where the sensors stand, from a box of known size that all of them see."""
