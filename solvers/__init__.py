"""Solvers: one contract, one module per library, and their catalogue."""

if __name__ != "polhode.solvers":
    raise ImportError(f"this package is imported as 'polhode.solvers', not as {__name__!r}")
