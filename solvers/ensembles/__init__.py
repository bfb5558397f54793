"""Integrators of many particles at once; imports `models` and the compilation of `solvers`."""
