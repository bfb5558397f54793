"""Massive spheroids: planes, projections, motion, the pinch point."""
