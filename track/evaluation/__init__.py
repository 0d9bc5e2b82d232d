"""The programs that measure how right and how fast the results are. They run from a checkout and are in no wheel."""
