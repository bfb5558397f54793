"""Massive triaxial ellipsoids: planes, space, motion."""
