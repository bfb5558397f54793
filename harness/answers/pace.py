"""Cost of a step of a method on this machine, measured once in a process.

A run takes seconds = start + step × steps + row × rows, from a scene to its observables. Three runs of
one fixed scene tell the three numbers: a long and a short one differ by steps alone, two equally long
ones by rows alone.
"""

from dataclasses import replace
from functools import lru_cache
from math import inf
from time import perf_counter
from typing import NamedTuple

import numpy as np

from polhode.harness.answers.fitted import PACED_TOLERANCE
from polhode.harness.answers.rules import Method
from polhode.models.scene import Scene
from polhode.models.scenes import named_scene
from polhode.models.spent import SPENT
from polhode.solvers.contract import SolverNotValidError
from polhode.solvers.solve import Solution, solve

# Scenes on which steps are timed: the first one that a method takes.
_TIMED = ("paper", "spheroid", "jeffery", "top", "tumbler", "sphere")
# Those of implicit solvers: on "stiff" each step has to solve equations.
_TIMED_IMPLICIT = ("stiff", *_TIMED)
# Times that a run is repeated: the quickest one is the least disturbed. An estimate: more repeats make `pick`
# slower where it asks about a method for the first time.
_REPEATS = 5
# Share of the scene's time that the short run covers: its steps cost as much as in the long run. An
# estimate: a larger share leaves a smaller difference of the two to time steps by.
_SHORT = 0.1
# Least seconds of the long run: it starts in some 0.2 ms, and its steps should take most of it. Its time
# grows by the factor `_LONGER` until it takes as long, or is longer than `_LONGEST`, in units of the
# inverse shear rate. Estimates.
_LEAST_SECONDS = 1e-3
_LONGER = 4.0
_LONGEST = 1e5
# Share of its time by which a scene is shortened, so that caches take it for another one; its steps,
# and so its cost, stay the same. The power of two is an estimate: some 4000 ulps, so that rounding of the
# time loses none of it.
_TRIFLE = 2.0**-40
# Rows of the run that times rows: as many as `polhode.solve` has by default.
_ROWS = 201


class Pace(NamedTuple):
    """Seconds of a run: to start, for a step, for a row; and what the method took to compile here.

    The compilation is the one in this process, 0 if the method had been compiled before it was timed.
    """

    start: float
    step: float
    row: float
    compilation: float

    def seconds(self, steps: float, rows: int) -> float:
        """Seconds of a run with these numbers of steps and rows."""
        return self.start + self.step * steps + self.row * rows


def pace(method: Method, tolerance: float) -> Pace:
    """The pace of a method, measured in some milliseconds where this process does not know it."""
    # The cost of a step depends on the tolerance only where the solver's order follows that.
    return _measured(method, tolerance if method.solver.order_by_tolerance else PACED_TOLERANCE)


def forget() -> None:
    """Forget what was measured."""
    _measured.cache_clear()


# The limit bounds memory alone: it is more than the pairs of a form and a solver.
@lru_cache(maxsize=500)
def _measured(method: Method, tolerance: float) -> Pace:
    """The pace of a method at a tolerance, from three runs of a fixed scene."""
    # The first run compiles. The long and the short run have two rows each, their start and their end.
    scene = _scene_for(method)
    compiled = SPENT.seconds["compilation"]
    long, steps = _quickest(method, tolerance, scene, 2)
    compilation = SPENT.seconds["compilation"] - compiled
    fixed = method.solver.closed_form or method.form.averaged or method.form.name == "hybrid"
    while long < _LEAST_SECONDS and scene.time < _LONGEST and not fixed:
        scene = replace(scene, time=_LONGER * scene.time)
        long, steps = _quickest(method, tolerance, scene, 2)
    short, fewer = _quickest(method, tolerance, replace(scene, time=_SHORT * scene.time), 2)
    with_rows, _ = _quickest(method, tolerance, scene, _ROWS)
    step = max(0.0, long - short) / max(1, steps - fewer)
    row = max(0.0, with_rows - long) / (_ROWS - 2)
    return Pace(max(0.0, short - step * fewer), step, row, compilation)


def _scene_for(method: Method) -> Scene:
    """The fixed scene on which a method's steps are timed: what a step costs hardly depends on it."""
    for name in _TIMED_IMPLICIT if method.solver.implicit else _TIMED:
        scene = named_scene(name)
        if method.form.takes(scene) and method.solver.takes(method.form.problem(scene)):
            return scene
    raise SolverNotValidError(
        "takes none of the scenes on which steps are timed", method.solver.name
    )


def _quickest(method: Method, tolerance: float, scene: Scene, rows: int) -> tuple[float, int]:
    """Seconds from a scene to its observables, of the quickest of some runs, and its steps."""
    least = inf
    steps = 0
    for number in range(_REPEATS):
        # A form may have cached results of a scene: each run has a scene of its own.
        new_scene = unseen(scene, rows + number)
        compiled = SPENT.seconds["compilation"]
        began = perf_counter()
        problem = method.form.problem(new_scene)
        times = np.linspace(0.0, problem.end, rows)
        solution = solve(problem, method.solver, tolerance, times)
        method.form.observe(new_scene, solution.states)
        seconds = perf_counter() - began - (SPENT.seconds["compilation"] - compiled)
        if seconds < least:
            least = seconds
            steps = steps_in(solution)
    return least, steps


def unseen(scene: Scene, number: int) -> Scene:
    """A scene of which nothing is cached, and that costs what this one does: a trifle shorter."""
    return replace(scene, time=scene.time * (1 - number * _TRIFLE))


def steps_in(solution: Solution) -> int:
    """Steps of a run, with rejected steps and steps of its own check runs; 0 where unknown."""
    work = solution.work
    return (work.steps or 0) + (work.rejected or 0) + (work.inner or 0)
