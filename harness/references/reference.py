"""References: solutions in extended precision where that is affordable, certified, with a stated uncertainty.

docs/method.md, "References", says in short how they are made. A *contestant* is a method that is judged
by the reference. *Moved* runs start with each number half an ulp away, which double precision cannot tell. An
ulp is the distance of neighbouring numbers in double precision.
"""

from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import chain
from math import inf, isfinite, isnan
from time import perf_counter
from typing import Any

import numpy as np

from polhode.harness.common import cache
from polhode.harness.common.files import digest
from polhode.harness.common.timing import within
from polhode.harness.references.certificate import Certificate, certify, observe, segments
from polhode.harness.references.chaos import growth
from polhode.harness.references.errors import errors, magnitude, statistics_distance
from polhode.harness.references.extended import (
    ROUNDING_RUN,
    ReferenceFailedError,
    Run,
    extended_run,
    unlike_runs,
)
from polhode.harness.references.rotations import rotations
from polhode.models.catalogue import form as find_form, full_form, reference_form
from polhode.models.form import Form
from polhode.models.libraries import version_of
from polhode.models.observables import Observables
from polhode.models.problem import Problem
from polhode.models.scene import Scene
from polhode.solvers.catalogue import solver as find_solver
from polhode.solvers.contract import Status
from polhode.solvers.solve import solve
from polhode.solvers.taylor import extends_precision

# Tight and loose run, each with its precision and tolerance. An ulp of long double is 1e-19; a tight run's
# tolerance is a hundredth of the loose run's or less. Their difference, times the safety factor, is the
# reference's own uncertainty. The factor is an estimate, on the safe side: the tighter run errs less than the
# looser.
_QUADRUPLE: tuple[Run, Run] = (("quadruple", 1e-22), ("long double", 1e-19))
LONG_DOUBLE: tuple[Run, Run] = (("long double", 1e-19), ("long double", 1e-17))
SAFETY = 10.0
# Up to the first cost of a run quadruple precision is used, some 40 times as slow. Up to the second one two
# starts are moved instead of one. A cost is the scene's time, in inverse shear rates, and more where rotation is
# fast or stability limits the step. Both are estimates: twice as large ones make the longest runs take twice as
# long.
QUADRUPLE_UP_TO_COST = 5000.0
_TWO_MOVED_UP_TO_COST = 2e5
# Length of Taylor's interval of stability on the negative real axis: 9.2 at order 21, of tolerance 1e-17, 9.9 at
# order 23, of 1e-19. The number is on the safe side.
_STABLE = 8.0
# Angular velocity, in shear rates, up to which the scene's time alone tells the cost; an estimate.
_ORDINARY = 3.0
# Up to this St a run of any duration has extended precision, if its seconds are not limited. Above it runs may
# be so long that they would take hours. There runs longer than `EXTENDED_TIME`, in inverse shear rates, are
# known by `_compared` alone, and those beyond `_HORIZON` not at all. All three are estimates, which bound the
# time that a reference takes.
EXTENDED_UP_TO_STOKES = 1e6
EXTENDED_TIME = 5e6
_HORIZON = 5e7
# Seeds of the moved runs: which numbers of start and parameters move up, and which down. Any would do.
_ROUNDING_SEEDS = (1, 2)
# Distance from which on a reference is examined for chaos: of moved runs, or of two unlike methods. Its unit is
# rad, or for L and E the largest of I_max, E and the components of L. An estimate.
_SUSPICIOUS = 1e-9
# Up to the first number of rotations a run in limited time has extended precision. Up to the second one it is
# known by `_compared`, beyond it not at all. Both are estimates, which bound the time.
EXTENDED_UP_TO_ROTATIONS = 2e4
MOST_ROTATIONS = 2e5
# Solver and tolerance of the first method of `_compared`, whose solution is the reference: for spheroids and spheres,
# and for other shapes. The tolerances, here and below, are estimates near rounding.
_SPHEROIDS = ("splitting-extended", 1e-13)
_OTHERS = ("taylor", 1e-15)
# Solver and tolerance of the second method, which the reference is compared with.
AGAINST = ("cyrk-vern8", 1e-14)
# The second method without CyRK; SciPy takes no tolerance below 2.2e-14.
_AGAINST_WITHOUT = ("dop853", 1e-13)
# In the longest runs the method `AGAINST` loses the phase. It still confirms the reference. The
# uncertainty follows from this further run, which errs as much as the reference: it is `_ALIKE` times
# their distance. The factor is an estimate, as two runs of a method may err alike.
_FURTHER = ("taylor", 1e-16)
_ALIKE = 3.0
# Difference of L and E, over I_max, from which on two methods do not confirm each other. Without heyoka it is
# over the largest of I_max, E and the components of L. An estimate.
APART = 1e-4
# Most intervals in which the growth of small differences is followed; an estimate.
_MOST_INTERVALS = 2000
# Error, in rad or over I_max, that a method in double precision makes at the worst moment. If the motion is
# chaotic, trajectories mean something until this error has grown too large. An estimate: growth is exponential, so that
# with twice the error the time is hardly shorter.
_DOUBLE_ERROR = 1e-13
# Version of what is cached: references of another one are computed anew.
_SCHEMA = 10
# Changes with what certifies a reference: those that failed before are tried again.
_CERTIFICATES = 2


@dataclass(frozen=True)
class Reference:
    """Observables of a form's exact solution, how well they are known, and what confirmed them.

    Uncertainties are those over the meaningful samples. In extended precision they are not less than the
    spread from half an ulp in start and parameters.
    """

    form: str
    times: np.ndarray  # in the form's own time
    observables: Observables
    slow_uncertainty: float  # over I_max
    orientation_uncertainty: float | None  # in rad
    certificate: Certificate
    precision: str  # of the tight run
    # Samples over which errors of trajectories mean anything: all unless the motion is chaotic.
    meaningful: int
    # `statistics_distance` of runs that double precision cannot tell apart.
    statistics_uncertainty: float

    @property
    def meaningful_until(self) -> float | None:
        """Last time, in the form's own time, at which errors of trajectories mean anything; None if at all times."""
        return (
            None if self.meaningful == len(self.times) else float(self.times[self.meaningful - 1])
        )


def reference(scene: Scene, form: str | Form, samples: int, seconds: float = inf) -> Reference:
    """Reference solution of a scene by a form's own equations, from the cache or computed and certified.

    Taylor runs in extended precision, from the very parameters in double precision that the
    contestants receive. A full form gives the reference of all full forms; an averaged one its own
    exact solution. Long runs, within limited seconds or above St = 1e6, are known by two methods that
    confirm each other. So are all runs where heyoka, which brings extended precision, is missing.

    Parameters
    ----------
    scene
        The scene.
    form
        A form, or its name.
    samples
        Number of times, equispaced from 0 to the end, both included.
    seconds
        Most seconds to compute. A failure is cached too, and tried again only with more seconds.

    Raises
    ------
    ReferenceFailedError
        If a run does not reach its end in that time, is contradicted by its certificate or by a second
        method, or has too long a time or too many rotations.
    """
    shape = find_form(form) if isinstance(form, str) else form
    long = False
    if not shape.averaged:
        shape = find_form(reference_form(scene))
        long = _far(scene)
        if long and scene.time > _HORIZON:
            raise ReferenceFailedError(
                f"time: got {scene.time:g}, expected at most {_HORIZON:g} above St = 1e6"
            )
    problem = shape.problem(scene)
    if not shape.averaged and seconds < inf and 0 < scene.stokes < inf:
        try:
            turns = _rotations(scene)
        except ValueError as error:
            raise ReferenceFailedError(str(error)) from None
        if turns > MOST_ROTATIONS:
            raise ReferenceFailedError(f"more than {MOST_ROTATIONS:g} rotations")
        long = long or turns > EXTENDED_UP_TO_ROTATIONS
    # Averaged equations are the same however the body axes are numbered; the orientation is not.
    key = _key(problem, samples, long, scene.ellipsoid.scaled_axes if shape.averaged else ())
    arrays = cache.load(key)
    if arrays is None or _tried_less(arrays, seconds):

        def computed(limit: float) -> dict[str, Any]:
            """The result to cache of a try of at most `limit` seconds: the reference, or its failure."""
            try:
                if not extends_precision():
                    run = partial(_unlike, scene, shape, problem)
                elif long:
                    run = partial(_compared, scene)
                else:
                    run = partial(_compute, scene, shape, problem)
                return _packed(run(samples, perf_counter() + limit))
            except (ReferenceFailedError, ValueError) as error:
                failed = {"failure": str(error), "status": getattr(error, "status", "")}
                return failed | {"seconds": seconds, "certificates": _CERTIFICATES}

        # A try that ran out of time because the machine was busy is not cached.
        arrays, disturbed = within(
            seconds, computed, lambda record: str(record.get("status")) == Status.TIME_LIMIT
        )
        if not disturbed:
            arrays = cache.save(key, arrays)
    if "failure" in arrays:
        raise ReferenceFailedError(str(arrays["failure"]), str(arrays["status"]))
    return _unpacked(shape, arrays)


# Asked for every case of a scene, one after the other; some scenes take a quarter of a second. Ten scenes are
# kept, an estimate.
_rotations = lru_cache(maxsize=10)(rotations)


def _far(scene: Scene) -> bool:
    """Whether extended precision would take too long."""
    return (
        isfinite(scene.stokes)
        and scene.stokes > EXTENDED_UP_TO_STOKES
        and scene.time > EXTENDED_TIME
    )


def _tried_less(arrays: dict[str, np.ndarray], seconds: float) -> bool:
    """Whether the cached record is a failure that a trial of `seconds` may overcome."""
    if "failure" not in arrays:
        return False
    # Records of early versions have no status.
    judged = "status" in arrays and int(arrays["certificates"]) == _CERTIFICATES
    return not judged or float(arrays["seconds"]) < seconds


def _compute(
    scene: Scene, form: Form, problem: Problem, samples: int, deadline: float
) -> Reference:
    """Reference of a form in extended precision, certified.

    Runs have rows at the samples, and at the ends of the certificate's segments between them. If the moved
    runs part too far, chaos is looked for; errors count over the first `meaningful` samples alone.
    """
    times = np.linspace(0.0, problem.end, samples)
    segment_times = [*chain(*segments(scene, form, problem.end)), problem.end]
    row_times = np.union1d(times, segment_times)
    sample_rows = np.searchsorted(row_times, times)
    segment_rows = np.searchsorted(row_times, segment_times)
    (precision, tight_tolerance), loose_run, seeds = _runs(scene, form)
    states = extended_run(problem, row_times, precision, tight_tolerance, deadline)
    tight = observe(form, scene, states[sample_rows])
    loose_states = extended_run(problem, row_times, *loose_run, deadline)
    loose = observe(form, scene, loose_states[sample_rows])
    moved_states = (
        extended_run(_rounded_otherwise(problem, seed), times, *ROUNDING_RUN, deadline)
        for seed in seeds
    )
    moved = [observe(form, scene, moved_run) for moved_run in moved_states]
    states_of = dict(zip(segment_times, states[segment_rows], strict=True))
    certificate = certify(scene, form, problem, states_of)
    spread = [errors(scene.ellipsoid, moved_run, tight) for moved_run in moved]
    # Rounding of a large L or E is large too: it is no sign of chaos.
    size = max(1.0, magnitude(scene.ellipsoid, tight))
    largest = max(max(shift.slow / size, shift.orientation or 0.0) for shift in spread)
    meaningful = samples
    if largest > _SUSPICIOUS:
        grown = growth(problem, min(_MOST_INTERVALS, samples - 1))
        if grown.chaotic:
            until = grown.meaningful_until()
            # Two at least: at the start alone nothing has an error.
            meaningful = max(2, int(np.searchsorted(times, until, side="right")))
    numerical_error = errors(scene.ellipsoid, loose[:meaningful], tight[:meaningful])
    early = [
        errors(scene.ellipsoid, moved_run[:meaningful], tight[:meaningful]) for moved_run in moved
    ]
    slow = max(SAFETY * numerical_error.slow, *(shift.slow for shift in early))
    orientation = None
    if numerical_error.orientation is not None:
        orientation = max(
            SAFETY * numerical_error.orientation, *(shift.orientation or 0.0 for shift in early)
        )
    distance = max(statistics_distance(scene.ellipsoid, moved_run, tight) for moved_run in moved)
    return Reference(
        form=form.name,
        times=times,
        observables=tight,
        slow_uncertainty=slow,
        orientation_uncertainty=orientation,
        certificate=certificate,
        precision=precision,
        meaningful=meaningful,
        statistics_uncertainty=distance,
    )


def _compared(scene: Scene, samples: int, deadline: float) -> Reference:
    """Reference of a scene's full equations where extended precision would take too long.

    The first method's solution is the reference. The second method must agree with it.
    """
    times = np.linspace(0.0, scene.time, samples)

    def run(form: str, solver: str, tolerance: float) -> Observables:
        """Observables at `times`; raises ReferenceFailedError if the run does not reach the end."""
        equations = find_form(form)
        solution = solve(
            equations.problem(scene),
            solver,
            tolerance,
            times,
            max_seconds=deadline - perf_counter(),
        )
        if not solution.success:
            raise ReferenceFailedError(
                f"the reference by {solver} ended with {solution.status}", solution.status
            )
        return equations.observe(scene, solution.states)

    varies = scene.flow is not None and scene.flow.varies
    splits = (
        scene.ellipsoid.kind != "triaxial" and not varies and find_solver(_SPHEROIDS[0]).available
    )
    exact = run(full_form(scene), *(_SPHEROIDS if splits else _OTHERS))
    against = AGAINST if find_solver(AGAINST[0]).available else _AGAINST_WITHOUT
    second = run("quaternion", *against)
    apart = errors(scene.ellipsoid, second, exact)
    if not apart.slow < APART:
        raise ReferenceFailedError(f"two methods are {apart.slow:.1g} apart")
    # The second method errs more than the first: their distance is about its error, and no factor is needed.
    doubt = 1.0
    if _far(scene):
        second = run("quaternion", *_FURTHER)
        doubt = _ALIKE
        apart = errors(scene.ellipsoid, second, exact)
    return Reference(
        form=reference_form(scene),
        times=times,
        observables=exact,
        slow_uncertainty=doubt * apart.slow,
        orientation_uncertainty=None if apart.orientation is None else doubt * apart.orientation,
        # The whole run is the one segment that the second method solved too.
        certificate=Certificate("quaternion", against[0], segments=1, back=0, ratio=1.0),
        precision="double",
        meaningful=samples,
        statistics_uncertainty=statistics_distance(scene.ellipsoid, second, exact),
    )


def _unlike(scene: Scene, form: Form, problem: Problem, samples: int, deadline: float) -> Reference:
    """Reference of a form without heyoka: two unlike methods in double precision."""
    times = np.linspace(0.0, problem.end, samples)
    (_, states), (second_solver, second_states) = unlike_runs(problem, times, deadline).items()
    exact = form.observe(scene, states)
    second = form.observe(scene, second_states)
    size = max(1.0, magnitude(scene.ellipsoid, exact))
    apart = errors(scene.ellipsoid, second, exact)
    meaningful = samples
    largest = max(apart.slow / size, apart.orientation or 0.0)
    if largest > _SUSPICIOUS:
        grown = growth(problem, min(_MOST_INTERVALS, samples - 1))
        if grown.chaotic:
            until = grown.meaningful_until(_DOUBLE_ERROR)
            meaningful = max(2, int(np.searchsorted(times, until, side="right")))
            apart = errors(scene.ellipsoid, second[:meaningful], exact[:meaningful])
    if not apart.slow < APART * size:
        raise ReferenceFailedError(f"two methods are {apart.slow:.1g} apart")
    rounding = float(np.finfo(float).eps) * size
    orientation = apart.orientation
    return Reference(
        form=form.name,
        times=times,
        observables=exact,
        slow_uncertainty=SAFETY * max(apart.slow, rounding),
        orientation_uncertainty=(
            None if orientation is None else SAFETY * max(orientation, rounding)
        ),
        certificate=Certificate(form.name, second_solver, segments=1, back=0, ratio=1.0),
        precision="double",
        meaningful=meaningful,
        statistics_uncertainty=statistics_distance(scene.ellipsoid, second, exact),
    )


def _packed(solution: Reference) -> dict[str, Any]:
    """A reference as it is cached, of which `cache.save` makes arrays."""
    by = solution.certificate
    orientation = solution.orientation_uncertainty
    return {
        **{
            name: value
            for name, value in vars(solution).items()
            if name not in ("form", "observables", "certificate")
        },
        **{name: value.astype(float) for name, value in vars(solution.observables).items()},
        "orientation_uncertainty": np.nan if orientation is None else orientation,
        "certificate_by": [by.form, by.solver],
        "certificate": [by.segments, by.back, by.ratio],
    }


def _unpacked(form: Form, arrays: dict[str, np.ndarray]) -> Reference:
    """The reference that `_packed` made arrays of."""
    names = (
        "slow_uncertainty",
        "orientation_uncertainty",
        "precision",
        "meaningful",
        "statistics_uncertainty",
    )
    fields: dict[str, Any] = {name: arrays[name].item() for name in names}
    if isnan(fields["orientation_uncertainty"]):
        fields["orientation_uncertainty"] = None
    # Earlier versions cached further numbers behind these three.
    count, back, ratio, *_ = arrays["certificate"].tolist()
    by_form, by_solver = arrays["certificate_by"].tolist()
    certificate = Certificate(by_form, by_solver, int(count), int(back), ratio)
    observables = Observables(arrays["angular_momentum"], arrays["energy"], arrays["rotation"])
    return Reference(form.name, arrays["times"], observables, certificate=certificate, **fields)


def _runs(scene: Scene, form: Form) -> tuple[Run, Run, tuple[int, ...]]:
    """Tight and loose run of a scene, and the seeds of the moved ones; a cheap run has the better of each.

    The cost is the time times what is largest: 1, the steps that stability asks for, or fast rotation.
    """
    if form.averaged:
        return *LONG_DOUBLE, _ROUNDING_SEEDS
    stiffness = (
        0.0 if scene.stokes == 0 else max(scene.ellipsoid.damping) * scene.torque_factor / _STABLE
    )
    cost = scene.time * max(
        1.0, stiffness, float(np.max(np.abs(scene.angular_velocity))) / _ORDINARY
    )
    runs = _QUADRUPLE if cost <= QUADRUPLE_UP_TO_COST else LONG_DOUBLE
    return *runs, _ROUNDING_SEEDS if cost <= _TWO_MOVED_UP_TO_COST else _ROUNDING_SEEDS[:1]


def _rounded_otherwise(problem: Problem, seed: int) -> Problem:
    """The problem with each number of start and parameters, but for zeros, moved by half an ulp, up or down."""
    generator = np.random.default_rng(seed)

    def moved(values: tuple[float, ...]) -> tuple[np.longdouble, ...]:
        exact = np.array(values, dtype=np.longdouble)
        ulp = np.spacing(np.abs(np.array(values)))
        signs = generator.choice([-0.5, 0.5], len(values))
        return tuple(np.where(exact == 0, exact, exact + signs * ulp))

    return replace(problem, start=moved(problem.start), parameters=moved(problem.parameters or ()))


def _key(problem: Problem, samples: int, long: bool = False, axes: tuple[float, ...] = ()) -> str:
    """Hash of all that a cached reference depends on; `axes` has the semi-axes of an averaged form's body.

    `long` is whether `_compared` makes the reference.
    """
    extended = (
        _QUADRUPLE,
        LONG_DOUBLE,
        ROUNDING_RUN,
        _ROUNDING_SEEDS,
        QUADRUPLE_UP_TO_COST,
        _TWO_MOVED_UP_TO_COST,
    )
    content = {
        "schema": _SCHEMA,
        "form": problem.name,
        "start": [float(value).hex() for value in problem.start],
        "parameters": [float(value).hex() for value in (*(problem.parameters or ()), *axes)],
        "end": float(problem.end).hex(),
        "samples": samples,
        "runs": (_SPHEROIDS, _OTHERS, AGAINST) if long else extended,
        "heyoka": version_of("heyoka"),
    }
    if problem.parameter_table is not None:
        table = problem.parameter_table
        content["parameter_table"] = [table.times.tobytes().hex(), table.values.tobytes().hex()]
    return digest(content)
