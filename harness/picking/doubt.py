"""Claimed success doubted: a run is compared with two sharp runs, and fails if they agree that it is far off.

Only a run whose stated error is large or not known is compared, so that others pay nothing.
"""

import numpy as np

from polhode.harness.common.text import scientific, short
from polhode.harness.picking.pilot import pilot_solver
from polhode.harness.picking.stated_error import RunError
from polhode.harness.references.errors import magnitude
from polhode.models.form import Form
from polhode.models.observables import Observables
from polhode.models.scene import Scene
from polhode.solvers.contract import SolverNotValidError
from polhode.solvers.solve import Solution, solve

# A success is false if L or E is off by more than this, over I_max, and by this share of the largest of them.
OFF, SHARE = 0.1, 0.01
# Tolerances of the sharp runs. They agree if the distance between them is this share of the run's distance from them:
# those of a chaotic motion do not, and say nothing.
SHARP, AGREE = (1e-10, 1e-12), 0.1
# Seconds that a sharp run may take at least, and over those of the run, where its stated error is large or not known.
SUSPECTED, UNKNOWN = (2.0, 20.0), (0.25, 4.0)


def doubt(scene: Scene, form: Form, found: Solution, observables: Observables, stated: RunError) -> str:
    """Why a claimed success is none; empty if nothing speaks against it, or nothing that is sure."""
    unit = max(scene.ellipsoid.inertia)
    limit = max(OFF, SHARE * magnitude(scene.ellipsoid, observables))
    if not found.success or (stated.slow and stated.slow.high <= limit):
        return ""
    least, times = SUSPECTED if stated.slow else UNKNOWN
    seconds = max(least, times * found.seconds)
    name = pilot_solver(scene)
    first: np.ndarray | None = None
    off = 0.0
    for tolerance in SHARP:
        try:
            run = solve(found.problem, name, tolerance, found.times, max_seconds=seconds)
        except SolverNotValidError:
            return ""
        sharp = form.observe(scene, run.states).slow
        off = float(np.max(np.abs(observables.slow - sharp))) / unit if run.success else 0.0
        if off <= limit or (first is not None and np.max(np.abs(first - sharp)) / unit > AGREE * off):
            return ""
        first = sharp
    return f"L or E is off by {scientific(off)} of I_max, as two runs by {name} at {short(SHARP[0])} and tighter agree"
