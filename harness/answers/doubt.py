"""Whether a run that claims success is to be believed.

A *sharp* run is one at a tolerance so tight that its own error counts for nothing (`rules.SHARP`).
`confirmed` makes a failure of a success that is doubted (`Status.FALSE_SUCCESS`).
docs/false-successes.md counts what that finds.
"""

import numpy as np

from polhode.harness.answers.rules import SHARP, full_solver
from polhode.harness.answers.runs import Run, Runner
from polhode.harness.answers.statement import RunError
from polhode.harness.common.text import scientific, short
from polhode.harness.references.errors import magnitude
from polhode.solvers.contract import SolverNotValidError

# A success is false if L or E is off by more than this, over I_max, and by this share of the
# largest of them. The first holds for slow bodies, the second for fast ones, where it is the larger.
# Both are estimates: with half as large ones more runs would be examined, and pay for it.
OFF = 0.1
OFF_SHARE = 0.01
# Tolerances of two sharp runs, far enough apart that chaos shows: their errors differ by about a hundred
# times, and chaos makes both as large as the motion. The ratio is an estimate.
_SHARP = (100 * SHARP, SHARP)
# The sharp runs agree if their distance is at most this share of the run's from the second of them;
# runs of a chaotic motion do not agree, and say nothing. The share is an estimate: errors that are doubted
# are far larger than the distance of sharp runs of a regular motion.
_AGREE = 0.1


def doubt(runner: Runner, run: Run, stated: RunError) -> str:
    """Why a claimed success is none; empty if nothing speaks against it, or nothing that is sure.

    Only a run whose error is large or unknown is compared with sharp runs: others pay nothing. A second
    sharp run is made only if the first one contradicts the run. They are of the run's own form, so that
    the error of averaging is not looked at, and L and E alone are compared, not the orientation. If a
    sharp run fails, nothing is sure.

    Parameters
    ----------
    runner : Runner
        It ran the run, and runs the sharp ones of the same scene.
    run : Run
    stated : RunError
        The error that the run states.
    """
    # First what costs nothing: `limit` below is `OFF` or more.
    if not run.success or (stated.slow and stated.slow.high <= OFF):
        return ""
    unit = max(runner.scene.ellipsoid.inertia)
    limit = max(OFF, OFF_SHARE * magnitude(runner.scene.ellipsoid, run.observables))
    if stated.slow and stated.slow.high <= limit:
        return ""
    form = run.method.form
    method = run.method._replace(solver=full_solver(runner.scene, form))
    # L and E of the first sharp run at the n compared times, shape (n, 4).
    first_sharp: np.ndarray | None = None
    # Distance of the run from a sharp one, over I_max; after the loop from the second.
    distance = 0.0
    for tolerance in _SHARP:
        try:
            sharp_run = runner.run(method, tolerance, run.limit)
        except SolverNotValidError:
            # If no solver is installed that takes the form, `full_solver` gives one that refuses it.
            return ""
        if not sharp_run.success:
            return ""
        sharp = sharp_run.observables.slow
        distance = float(np.max(np.abs(run.observables.slow - sharp))) / unit
        if distance <= limit:
            return ""
        if first_sharp is not None:
            between = np.max(np.abs(first_sharp - sharp)) / unit
            if between > _AGREE * distance:
                return ""
        first_sharp = sharp
    agree = f"two runs by {method.solver.name} at {short(_SHARP[0])} and tighter agree"
    return f"L or E is off by {scientific(distance)} of I_max, as {agree}"
