"""Measuring and fitting the laws, and the held-out test of `pick`; imports `api`."""
