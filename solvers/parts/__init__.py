"""Solvers of problems that state their parts (`models.problem.Parts`); imports contract, `compile`, `machine_code`."""
