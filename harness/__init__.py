"""Harness: what users see (`api`, `cli`, `work_precision`) on top of its folders; imports models and solvers."""

if __name__ != "polhode.harness":
    raise ImportError(f"this package is imported as 'polhode.harness', not as {__name__!r}")

# The defaults stand here, since `polhode solve --help` names them and is to import nothing else.
# Equispaced times of the output: 200 equal intervals between start and end. A convention: rows cost
# little beside the run.
DEFAULT_SAMPLES = 201
# Largest error allowed, of L and E over I_max or of the orientation in rad. A convention: the
# tightest error in the front page's tables, which say what it costs.
DEFAULT_ERROR = 1e-6
