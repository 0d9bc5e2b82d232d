"""The experiments of the paper, and those its authors wished for, each in a module of its own."""
