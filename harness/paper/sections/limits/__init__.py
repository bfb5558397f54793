"""Euler tops and Jeffery orbits: the limits of large and small Stokes number."""
