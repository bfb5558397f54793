"""Time to an answer over plain practice: random scenes, each solved once in a process that has compiled its forms.

Plain practice is what a careful user does: the full form by one solver, tightened tenfold until two
runs agree to half the error. All its runs are paid, but for compilation. Scenes solved beforehand
compile what answers need; what an answer compiles beyond that is paid. Times are wall time in seconds,
errors of L and E are over I_max, errors of the orientation in rad. `polhode validate --time` runs
the study.
"""

import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from math import acos, inf, pi
from time import perf_counter, process_time
from typing import NamedTuple

import numpy as np

from polhode.harness.answers.rules import stiff
from polhode.harness.answers.statement import difference
from polhode.harness.common.progress import in_steps
from polhode.harness.references.errors import errors
from polhode.models.catalogue import form as find_form, full_form
from polhode.models.observables import Observables
from polhode.models.scene import BodyStart, EulerStart, Scene
from polhode.models.shape import Ellipsoid
from polhode.models.spent import SPENT
from polhode.solvers.catalogue import solver as find_solver
from polhode.solvers.solve import solve

# The timed function. It takes a scene, an error and what that is of, "slow" (L and E) or "orientation". It gives
# observables at `TIMED_ROWS` times, None if it failed; the upper end of the stated error, None if it states none;
# and the method, or why there is none.
Ask = Callable[[Scene, float, str], tuple[Observables | None, float | None, str]]

# Strata by the seconds of plain practice, each below its number and above the one before. The targets,
# which are set and not measured, are what an answer may take over plain practice: in the median, and in
# nine of ten scenes.
_STRATA = {"below 10 ms": 0.01, "10 to 100 ms": 0.1, "above 0.1 s": inf}
_TARGETS = {"below 10 ms": (1.4, 3.0), "10 to 100 ms": (0.8, 1.2), "above 0.1 s": (0.3, 1.0)}
# The targets on a machine that is busy are this multiple of those; set, not measured.
_BUSY = 2.0
# Rows of a solution, equispaced; a choice.
TIMED_ROWS = 201
# How scenes are drawn: choices, so that answers of all strata occur. "Decades" are the least and the largest
# log₁₀. Decades of the two shorter semi-axes over the longest, of St and of the error.
_AXES = (-0.8, -0.02)
_STOKES = (-2.0, 7.0)
_ERRORS = (-9.0, -3.0)
# Decades of the slow time T/St of a run of duration T, above St = `_SLOW_TIME_FROM`. Up to it the duration
# is `_SHORT_TIME`, in inverse shear rates.
_SLOW_TIMES = (-1.3, 0.0)
_SLOW_TIME_FROM = 20.0
_SHORT_TIME = 20.0
# St from which on the orientation is not requested: it would have to be followed through all turns.
# An estimate.
_SLOW_FROM = 3e4
# The requested error is missed beyond this multiple of it: plain practice is the reference, whose own
# error may be half of it.
MISSED = 1.5
# Scenes that are solved first, so that all is compiled; an estimate.
_WARM_UP = 12
# Runs of plain practice, at most: they go from a tenth of the error to 1e-8 of it.
_RUNS = 8
# Its tightest tolerance, near what rounding allows.
_TIGHTEST = 1e-14
# Seconds after which a run of plain practice is stopped, which then agrees with none. An estimate: scenes
# whose runs take longer are left out.
_SECONDS = 60.0


class Timing(NamedTuple):
    """One scene: the answer beside plain practice."""

    name: str  # "seed-number"
    family: str  # of the body
    stokes: float
    error: float  # requested
    want: str  # what the error is of: "slow" or "orientation"
    method: str
    seconds: float  # of the answer
    plain: float  # seconds of plain practice
    apart: float  # largest difference of the two, in the unit of the error
    stated: float | None  # upper end of the answer's error; None if it states none
    # Seconds that tell the stratum: of plain practice without what other processes take of the processor.
    undisturbed: float

    @property
    def ratio(self) -> float:
        """Time to the answer over plain practice."""
        return self.seconds / self.plain


def drawn(seed: int, index: int) -> tuple[Scene, float, str, str]:
    """A random scene, an error, what it is of, and the family of the body; the same for the same numbers.

    Semi-axes are 1, the longest, and shorter ones from 0.16 to 0.955. Orientations are uniform;
    components of the angular velocity, in body axes and shear rates, are standard normal. Above St = 20
    a run takes a slow time T/St of 0.05 to 1, up to it 20 units of the inverse shear rate. Below
    `_SLOW_FROM` half of the scenes ask for the orientation.
    """
    random = np.random.default_rng((seed, index))
    middle, short = sorted(10 ** random.uniform(*_AXES, 2), reverse=True)
    # Families take turns: half of the scenes have triaxial bodies.
    family = ("triaxial", "triaxial", "prolate", "oblate")[index % 4]
    axes = {
        "triaxial": (1.0, middle, short),
        "prolate": (short, short, 1.0),
        "oblate": (1.0, 1.0, short),
    }[family]
    angles = (acos(random.uniform(-1, 1)), random.uniform(0, 2 * pi), random.uniform(0, 2 * pi))
    x, y, z = random.normal(size=3).tolist()
    stokes = float(10 ** random.uniform(*_STOKES))
    time = _SHORT_TIME
    if stokes > _SLOW_TIME_FROM:
        time = stokes * float(10 ** random.uniform(*_SLOW_TIMES))
    error = float(f"{10 ** random.uniform(*_ERRORS):.1e}")
    want = "orientation" if stokes < _SLOW_FROM and random.random() < 0.5 else "slow"
    a, b, c = (float(axis) for axis in axes)
    start = BodyStart(EulerStart(angles).quaternion, (x, y, z))
    return Scene(Ellipsoid((a, b, c)), stokes, start, time), error, want, family


def plain_practice(
    scene: Scene, error: float, want: str, samples: int
) -> tuple[float, Observables | None]:
    """Seconds and observables of plain practice; inf and None where it does not come to agree.

    The tolerances are a tenth of the error, a hundredth, and so on; the first run has none to agree with.
    The observables come from the tighter run, at `samples` equispaced times. The solver is implicit
    where the scene is stiff; where it does not take the full form, nothing is run.
    """
    form = find_form(full_form(scene))
    problem = form.problem(scene)
    solver = find_solver("cyrk-radau" if stiff(scene) else "cyrk-vern8")
    if not solver.takes(problem):
        return inf, None
    before: Observables | None = None
    began = perf_counter()
    compiling = SPENT.seconds["compilation"]
    for k in range(1, _RUNS + 1):
        tolerance = max(_TIGHTEST, error * 10.0**-k)
        # Each run pays for its problem, as separate calls of a solver do.
        problem = form.problem(scene)
        times = np.linspace(0.0, problem.end, samples)
        run = solve(problem, solver, tolerance, times, max_seconds=_SECONDS)
        observables = form.observe(scene, run.states) if run.success else None
        if observables and before:
            apart = getattr(errors(scene.ellipsoid, before, observables), want)
            if apart is not None and apart <= error / 2:
                seconds = perf_counter() - began - (SPENT.seconds["compilation"] - compiling)
                return seconds, observables
        before = observables
    return inf, None


def study(ask: Ask, seed: int, scenes: int, quiet: bool = False) -> Iterator[Timing]:
    """Time answers and plain practice on random scenes, those that plain practice solves.

    `scenes` is the number that is drawn; a bar shows the progress unless `quiet`.
    """
    # Numbers from `scenes` on: no timed scene is among them.
    for index in range(_WARM_UP):
        scene, error, want, _ = drawn(seed, scenes + index)
        ask(scene, error, want)
        plain_practice(scene, error, want, TIMED_ROWS)
    for index in in_steps(range(scenes), "answers timed", "scenes", quiet):
        scene, error, want, family = drawn(seed, index)
        began = perf_counter()
        observables, stated, method = ask(scene, error, want)
        seconds = perf_counter() - began
        processor = process_time()
        plain, true = plain_practice(scene, error, want, TIMED_ROWS)
        processor = process_time() - processor
        if true is None:
            continue
        apart = difference(scene.ellipsoid, observables, true).largest[want] if observables else inf
        yield Timing(
            f"{seed}-{index}",
            family,
            scene.stokes,
            error,
            want,
            method,
            seconds,
            plain,
            apart,
            stated,
            # Compilation counts in the processor's time alone.
            min(plain, processor),
        )


class Stratum(NamedTuple):
    """Scenes of one stratum: the ratio of times, and answers that missed or were in doubt."""

    name: str
    scenes: int
    median: float  # of the ratios
    nine_of_ten: float  # ratio that nine of ten scenes stay below
    total: float  # all answers over all of plain practice
    quicker: float  # share of the scenes where the answer took less time
    missed: int  # erred by more than `MISSED` times the error requested
    doubted: int  # met the error against plain practice, but stated a larger one or none
    targets: tuple[float, float]  # for the median and for nine of ten


@contextmanager
def busy(count: int) -> Iterator[None]:
    """Keep `count` other processes computing meanwhile."""
    command = [sys.executable, "-c", "while True: pass"]
    others = [subprocess.Popen(command) for _ in range(count)]
    try:
        yield
    finally:
        for other in others:
            other.kill()
            other.wait()


def strata(timings: Sequence[Timing], load: int = 0) -> list[Stratum]:
    """Timings by the time that plain practice takes undisturbed, measured beside `load` other processes.

    Strata without a scene are left out.
    """
    leeway = _BUSY if load else 1.0
    rows = []
    least = 0.0
    for name, most in _STRATA.items():
        mine = [timing for timing in timings if least <= timing.undisturbed < most]
        least = most
        if not mine:
            continue
        ratios = np.array([timing.ratio for timing in mine])
        missed = [timing for timing in mine if timing.apart > MISSED * timing.error]
        doubted = [
            timing
            for timing in mine
            if timing.apart <= timing.error and not (timing.stated or inf) <= timing.error
        ]
        rows.append(
            Stratum(
                name,
                len(mine),
                float(np.median(ratios)),
                float(np.quantile(ratios, 0.9)),
                sum(timing.seconds for timing in mine) / sum(timing.plain for timing in mine),
                float(np.mean(ratios < 1)),
                len(missed),
                len(doubted),
                (leeway * _TARGETS[name][0], leeway * _TARGETS[name][1]),
            )
        )
    return rows
