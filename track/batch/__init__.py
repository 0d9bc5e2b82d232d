"""Many recordings: adapted and tracked by several processes or machines, with one table at the end."""
