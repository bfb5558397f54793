"""Integrators of many particles at once.

They import the contract, `compile`, `machine_code` and `parts`; `one_by_one` imports the catalogue and `solve`.
"""
