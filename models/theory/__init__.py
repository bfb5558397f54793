"""Closed results that ensembles, events, tests and the paper's pages use; imports `models` and `forms`."""
