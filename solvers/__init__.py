"""Solvers: one contract, compilation, one module per library, and their catalogue; imports `models`."""

if __name__ != "polhode.solvers":
    raise ImportError(f"this package is imported as 'polhode.solvers', not as {__name__!r}")
