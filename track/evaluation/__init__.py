"""How right the results are: simulated performances with their truth, and errors against it."""
