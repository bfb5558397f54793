"""Integrators of many particles at once; imports contract, `compile`, `machine_code` and `parts`."""
