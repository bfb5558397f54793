"""Cost of `averaged-second-order` against St, and against first order and the full equations."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import nan

from polhode.harness.averaging.cases import PAPER, Timed, fastest, timed_run
from polhode.harness.references.errors import errors
from polhode.models.scene import Scene
from polhode.models.second_order.form import SecondOrder
from polhode.models.shape import Ellipsoid

AXES, SLOW_TIME = (1.0, 1.0, 2.0), 0.5
# Output times of a run.
FEW = 11
EXPONENTS = tuple(range(3, 9))
# St at which first order and the full equations are run too, the full ones to this slow error.
COMPARED, TARGET = 1e6, 1e-6
TOLERANCE = 1e-9
FULL_TOLERANCES = (1e-8, 1e-9, 1e-10, 1e-11, 1e-12)
FULL_SOLVERS = ("taylor", "cyrk-vern8", "cyrk-dop853")
TRUE_TOLERANCE = 1e-16
# The fastest of so many runs is told; those at different St take turns, so that slow moments of the machine meet all.
REPEATS, FULL_REPEATS = 50, 3


@dataclass(frozen=True)
class Cost:
    """Wall times of one run in s, `seconds` with the observables; the slow error where it was measured."""

    form: str
    solver: str
    tolerance: float
    stokes: float
    samples: int
    integration: float
    seconds: float
    slow: float


def costs(exponents: Sequence[int] = EXPONENTS, compared: float = COMPARED) -> Iterator[Cost]:
    """Cost of the second-order form at each power of ten of St; of first order and the full form at one of them.

    Of each full solver the loosest tolerance is taken that meets `TARGET`.
    """
    there = _scene(compared)
    true = timed_run(there, "spheroid-axis", TRUE_TOLERANCE, FEW).observables

    def cost(scene: Scene, name: str, solver: str, tolerance: float, run: Timed) -> Cost:
        slow = errors(scene.ellipsoid, run.observables, true).slow if scene == there else nan
        return Cost(name, solver, tolerance, scene.stokes, FEW, run.integration, run.seconds, slow)

    scenes, name = [_scene(10.0**exponent) for exponent in exponents], SecondOrder.name
    rounds = [[timed_run(scene, name, TOLERANCE, FEW) for scene in scenes] for _ in range(REPEATS)]
    for scene, *runs in zip(scenes, *rounds, strict=True):
        yield cost(scene, name, "taylor", TOLERANCE, min(runs, key=lambda run: run.seconds))
    name = "averaged-spheroid"
    yield cost(there, name, "taylor", TOLERANCE, fastest(REPEATS, there, name, TOLERANCE, FEW))
    name = "spheroid-axis"
    for solver in FULL_SOLVERS:
        for tolerance in FULL_TOLERANCES:
            if cost(there, name, solver, tolerance, timed_run(there, name, tolerance, FEW, solver)).slow <= TARGET:
                yield cost(there, name, solver, tolerance, fastest(FULL_REPEATS, there, name, tolerance, FEW, solver))
                break


def _scene(stokes: float) -> Scene:
    return Scene(Ellipsoid(AXES), stokes, PAPER, SLOW_TIME * stokes)
