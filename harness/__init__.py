"""Harness: what users see (`api`, `cli`, `work_precision`) on top of its folders; imports models and solvers."""

if __name__ != "polhode.harness":
    raise ImportError(f"this package is imported as 'polhode.harness', not as {__name__!r}")

# Equispaced times of the output where nobody says otherwise; here, since `polhode solve --help`
# names it.
DEFAULT_SAMPLES = 201
