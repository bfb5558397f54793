"""Solvers of problems that state their parts (`polhode.models.problem.Parts`); imports contract and `compile`."""
