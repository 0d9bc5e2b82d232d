"""How right a motion is: errors against the known truth of a simulated recording."""
