"""Whether all is here that the program needs: packages, and a machine that is fit."""
