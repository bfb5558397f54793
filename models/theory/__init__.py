"""Closed results that forms, tests and the paper's pages use; imports `models`, `forms` and `free_top`."""
