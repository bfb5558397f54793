"""The segments of a hybrid run: averaged to second order, or by the full equations."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from polhode.models.catalogue import form as find_form, full_form
from polhode.models.forms.spheroid import Spheroid
from polhode.models.observables import Observables
from polhode.models.problem import ROUNDING, Problem, Segment
from polhode.models.rotation import quaternion_from_matrix
from polhode.models.scene import Scene, start_from
from polhode.models.second_order import field as triaxial, spheroid as spheroidal
from polhode.models.second_order.form import SecondOrder, slow_start
from polhode.models.second_order.outline import PlannedSegment, outline
from polhode.models.second_order.path import LEAST_SPEED, plain_dephasing
from polhode.models.second_order.run import NotAveragedError, entered
from polhode.models.shape import Ellipsoid

Array = np.ndarray

# `PlannedSegment` and `Segment` have comments on their fields. In the first, `decisive` asks for a new look ahead
# behind the segment; `swing`, `phase` and `phase_per_error` are errors of angles, in rad. `turned` is the growth of
# the full equations' error, summed over slow time.
#
# Constants that stand "by trial" were tried on random starts, which reports/hybrid does not use.
# Its page counts how many runs stay within the error that they were asked for, and within the one
# that they state.
#
# Error of L and E, over I_max, that a tolerance requests of the whole run, over the tolerance; by trial.
ERROR_PER_TOLERANCE = 100.0
# Share of that error that segments of the full equations may take, by trial: averaging may take as
# much (`outline`).
FULL_SHARE = 0.5
# Error of L and E over the tolerance of the full equations, per radian that a body turns with
# |L||ω| below I_max, by trial. Solvers that err by more are run at tighter tolerances
# (`Solver.error_amplification`).
PER_RADIAN = 2e-2
# Tolerance of averaged segments, far below any error that is asked for: they cost next to nothing.
_AVERAGED_TOLERANCE = 1e-12
# Tolerances of the full equations, two in a decade: a short list, as some solvers compile for each
# tolerance anew.
_FULL_TOLERANCES = 1e-8, 3e-9, 1e-9, 3e-10, 1e-10, 3e-11, 1e-11, 3e-12, 1e-12, 3e-13, ROUNDING
# Least turns of the body for which the plan looks ahead. An estimate: a run of fewer turns costs less
# than the look.
_SHORT = 1000
# Turns by which a segment of the full equations is lengthened where no slow state belongs to its end; by
# trial. With fewer the plan asks for a slow state more often, with more it runs longer in full.
_MORE = 50


def foreseen(scene: Scene, error: float) -> tuple[PlannedSegment, ...]:
    """Segments of a run for a requested error of L and E, over I_max; one full segment if the run is short."""
    if speed(scene) * scene.time < 2 * np.pi * _SHORT:
        return (
            PlannedSegment(
                0.0,
                scene.slow_time,
                False,
                "the run is short",
                phase_per_error=plain_dephasing(scene.ellipsoid) * scene.time,
                turned=error_growth(scene) * scene.slow_time,
            ),
        )
    return outline(scene, error).segments


def error_growth(scene: Scene) -> float:
    """Growth rate of a solver's error where a scene starts, in shear rates, as `Path.error_growth` along a path."""
    size = float(np.linalg.norm(scene.initial.angular_momentum)) / max(scene.ellipsoid.inertia)
    return speed(scene) * max(1.0, size * speed(scene))


def speed(scene: Scene) -> float:
    """Approximate rate of turning, in rad per unit of time, no less than by the shear."""
    return max(LEAST_SPEED, float(np.linalg.norm(scene.angular_velocity)))


def observed(scene: Scene, state: Array) -> Observables:
    """Observables of a state of the full equations."""
    return find_form(full_form(scene)).observe(scene, state[None])


@dataclass(frozen=True)
class HybridPlan:
    """The plan of a scene's run; its states belong to the form of the full equations.

    `full` are the full equations. `segments` were foreseen at the time `since` from the run's
    state then. The segments before have taken `spent` of the requested error, of which full segments took
    `spent_full`. `carried` is the part of `spent` that the foreseen segments do not know: all of it at the
    time `since`, and what full segments have taken later.
    """

    scene: Scene
    full: Problem
    since: float = 0.0
    segments: tuple[PlannedSegment, ...] = ()
    spent: float = 0.0
    spent_full: float = 0.0
    carried: float = 0.0

    def __call__(self, time: float, state: Array, tolerance: float) -> Segment:
        """Return the next segment."""
        if not self.segments:
            return self._looked_ahead(time, state, tolerance)(time, state, tolerance)
        planned = self.segments[0]
        end = self.since + planned.end * self.scene.stokes
        if not planned.second_order:
            return self._full(planned, time, end, state, tolerance)
        try:
            problem, states = second_order(self.scene, state)
        except NotAveragedError as refusal:
            return self._until_averaged(planned, time, state, tolerance, str(refusal))
        angle = self.angle(planned) + planned.swing
        # In this order: problem, end, states, reason, error, angle, tolerance, and the plan behind it.
        return Segment(
            problem,
            end,
            states,
            "second order",
            planned.error,
            angle,
            _AVERAGED_TOLERANCE,
            replace(self, segments=self.segments[1:], spent=self.spent + planned.error),
            averaged=True,
        )

    def _looked_ahead(self, time: float, state: Array, tolerance: float) -> "HybridPlan":
        """The plan with the segments from here on, for the error that is left."""
        error = ERROR_PER_TOLERANCE * tolerance
        # A tenth of the error stays, by estimate, where segments have taken more than all of it: the run
        # goes on, and states what it costs.
        left = max(error - self.spent, error / 10)
        segments = foreseen(self.remaining(time, state), left)
        return replace(self, since=time, segments=segments, carried=self.spent)

    def _full(
        self, planned: PlannedSegment, time: float, end: float, state: Array, tolerance: float
    ) -> Segment:
        """A segment of the full equations; behind a decisive one the plan looks ahead anew."""
        later = self.segments[1:]
        chosen, cost = full_tolerance(
            (planned, *later), self.scene.stokes, tolerance, self.spent_full
        )
        then = replace(
            self,
            segments=() if planned.decisive else later,
            spent=self.spent + cost,
            spent_full=self.spent_full + cost,
            carried=self.carried + cost,
        )
        # In the order of `__call__`; states are the run's own.
        return Segment(
            replace(self.full, start=tuple(state.tolist())),
            end,
            None,
            planned.reason,
            cost,
            self.angle(planned, cost),
            chosen,
            then,
        )

    def _until_averaged(
        self, planned: PlannedSegment, time: float, state: Array, tolerance: float, reason: str
    ) -> Segment:
        """`_MORE` turns by the full equations, for no slow state belongs to this state; `reason` says why."""
        stokes = self.scene.stokes
        remaining = self.remaining(time, state)
        more = 2 * np.pi * _MORE / speed(remaining)
        dephasing = plain_dephasing(self.scene.ellipsoid)
        full = replace(
            planned,
            end=planned.start + more / stokes,
            second_order=False,
            reason=reason,
            decisive=True,
            phase=(self.spent - self.carried) * more * dephasing,
            phase_per_error=more * dephasing,
            turned=more * error_growth(remaining) / stokes,
        )
        return self._full(full, time, time + more, state, tolerance)

    def angle(self, planned: PlannedSegment, cost: float = 0.0) -> float:
        """Error in rad that angles gain in a segment by errors of L and E: those before it, and a full one's cost."""
        return min(np.pi, planned.phase + (self.carried + cost) * planned.phase_per_error)

    def remaining(self, time: float, state: Array) -> Scene:
        """The scene from a state of the full equations on, for the time that is left."""
        if time == 0 and tuple(state.tolist()) == self.full.start:
            return self.scene
        start = start_from(self.scene.ellipsoid, observed(self.scene, state))
        return replace(self.scene, start=start, time=self.scene.time - time)


def full_tolerance(
    ahead: Sequence[PlannedSegment], stokes: float, tolerance: float, spent_full: float
) -> tuple[float, float]:
    """Tolerance of the full equations in the first segment ahead, and the error of L and E expected of it.

    Segments of the full equations share their error by how long they last, which costs least;
    those before have taken `spent_full` of it. `tolerance` is that of the whole run.
    """
    first = ahead[0]
    error = FULL_SHARE * ERROR_PER_TOLERANCE * tolerance
    lasting = sum(later.end - later.start for later in ahead if not later.second_order)
    # As in `_looked_ahead`, a tenth stays where the share is spent.
    share = (
        (error - spent_full if spent_full < error else error / 10)
        * (first.end - first.start)
        / lasting
    )
    tolerances = tolerance, *(tighter for tighter in _FULL_TOLERANCES if tighter < tolerance)
    grows = PER_RADIAN * first.turned * stokes
    chosen = next((loose for loose in tolerances if loose * grows <= share), tolerances[-1])
    return chosen, max(chosen, ROUNDING) * grows


def second_order(scene: Scene, state: Array) -> tuple[Problem, Callable[[Array], Array]]:
    """The averaged problem of a scene from a full state on, and a map of its states to full ones.

    Raises NotAveragedError where no slow state belongs to the start.
    """
    ellipsoid = scene.ellipsoid
    factor = scene.torque_factor
    form = SecondOrder()
    if ellipsoid.kind == "triaxial":
        start = observed(scene, state)
        entry = entered(ellipsoid, factor, start.rotation[0], start.angular_momentum[0])
        problem = form.slow_problem(scene, triaxial.field, entry.state, entry.parameters)
        return problem, lambda states: states_of(ellipsoid, entry.observe(states))
    spheroid = Spheroid.of(ellipsoid)
    *momentum, px, py, pz = state.tolist()
    slow = slow_start(spheroid, factor, (*momentum, *spheroidal.unit((px, py, pz))))
    if slow is None:
        raise NotAveragedError("St is too small for |L|")
    problem = form.slow_problem(
        scene, spheroidal.field, (*slow, 0.0), spheroidal.parameters(spheroid, factor)
    )
    return problem, partial(spheroidal.exact, spheroid, factor)


def states_of(ellipsoid: Ellipsoid, observables: Observables) -> Array:
    """States of the form `quaternion`, shape (n, 7), that have these observables."""
    spin = np.einsum("nij,nj->ni", observables.rotation, observables.angular_momentum) / np.array(
        ellipsoid.inertia
    )
    return np.column_stack([quaternion_from_matrix(observables.rotation), spin])
