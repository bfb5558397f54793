"""The error that a run states, and whether a success is to be believed."""

from dataclasses import dataclass, replace
from math import pi

import numpy as np

from polhode.harness.answers.interval import Interval
from polhode.harness.common.text import in_two_digits, scientific, short
from polhode.harness.picking.pilot import InPieces, pilot_solver
from polhode.harness.picking.refusals import one_digit
from polhode.harness.references.errors import magnitude
from polhode.models.catalogue import form as find_form, full_form
from polhode.models.form import Form
from polhode.models.observables import Observables
from polhode.models.scene import Scene
from polhode.solvers.contract import SolverNotValidError
from polhode.solvers.solve import Solution, solve

# Share of the runs whose error stays below the upper end, as `polhode validate` counts.
BOUNDED = 0.975
# The tightest tolerance of a run, and of one that a run a hundred times tighter confirms.
TIGHTEST, CONFIRMED = 1e-15, 1e-13
# A success is false if L or E is off by more than this, over I_max, and by this share of the
# largest of them.
OFF, SHARE = 0.1, 0.01
# Tolerances of the sharp runs. They agree if the distance between them is this share of the run's
# distance from them: those of a chaotic motion do not, and say nothing.
SHARP, AGREE = (1e-10, 1e-12), 0.1
# What the pieces of a run state over its error, in the median of random starts (`polhode accuracy
# --order hybrid`).
STATED_OVER = 8.0
# Seconds that a sharp run may take at least, and over those of the run, where its stated error is
# large or not known.
SUSPECTED, UNSTATED = (2.0, 20.0), (0.25, 4.0)


@dataclass(frozen=True)
class RunError:
    """Estimated error of one run; None where it is not known or there is none."""

    slow: Interval | None  # of L and E over I_max
    orientation: Interval | None  # in rad
    note: str  # what the estimate rests on, or why there is none
    share: float = BOUNDED  # of the runs, whose error stays below the upper end
    seconds: float = 0.0  # what the estimate cost, compilation left out
    advice: str = ""  # what to do about an error asked for that was missed; empty if none was
    largest_lz: float = 0.0  # the whole run's largest |L_z| over I_max; 0 where it is not known
    axis: bool = False  # whether the orientation is that of a spheroid's symmetry axis

    def wanted(self, want: str) -> Interval | None:
        """That of what is wanted."""
        return self.slow if want == "slow" else self.orientation

    def words(self) -> str:
        """The errors in a line, that of L and E also as a share of the run's largest |L_z|, if it is smaller."""
        parts = []
        if self.slow:
            smaller = 0 < self.slow.high <= self.largest_lz
            share = in_two_digits(100 * self.slow.high / self.largest_lz) if smaller else ""
            of_lz = f", {share} % of the largest |L_z|" if share else ""
            parts.append(f"L and E within {scientific(self.slow.high)} of I_max{of_lz}")
        if self.orientation:
            of = "symmetry axis" if self.axis else "orientation"
            parts.append(f"{of} within {scientific(self.orientation.high)} rad")
        if not parts:
            return f"not known: {self.note}"
        return f"{'; '.join(parts)} (estimated; {100 * self.share:g} % of like runs)"

    def asked(
        self, error: float, want: str, form: Form, scene: Scene, tolerance: float
    ) -> "RunError":
        """The same with advice, if the error asked for was missed."""
        stated = self.wanted(want)
        if stated is None or stated.high <= error:
            return self
        # An interval that begins at 0 bounds the error, and proves nothing missed.
        sure = "was missed" if stated.low > error else "may have been missed"
        tighter, full = one_digit(tolerance * error / stated.high / 2), full_form(scene)
        what = "no second run could confirm a tighter one"
        # What pieces state does not fall with the tolerance.
        if form.averaged or (isinstance(form, InPieces) and not stated.low):
            able = f"do: --form {full}, whose error its tolerance alone sets"
            what = able if find_form(full).takes(scene) else "no full form takes such a start"
        elif tighter >= CONFIRMED:
            what = f"do: --tolerance {short(tighter)}"
        made = (
            f"about {scientific(stated.predicted)}, " if stated.low else ""
        ) + f"at most {scientific(stated.high)}"
        advice = f"the error asked for, {short(error)}, {sure}: it is {made}; {what}"
        return replace(self, advice=advice)


UNKNOWN = RunError(None, None, "not estimated")


def said_by_pieces(found: Solution) -> dict[str, float]:
    """Errors that a run's pieces state."""
    angle = sum(each.angle for each in found.stages)
    return {"slow": sum(each.error for each in found.stages), "orientation": min(pi, angle)}


def doubt(
    scene: Scene, form: Form, found: Solution, observables: Observables, stated: RunError
) -> str:
    """Why a claimed success is none; empty if nothing speaks against it, or nothing that is sure."""
    # Only a run whose stated error is large or not known is compared, with two sharp runs, so that
    # others pay nothing.
    unit = max(scene.ellipsoid.inertia)
    limit = max(OFF, SHARE * magnitude(scene.ellipsoid, observables))
    if not found.success or (stated.slow and stated.slow.high <= limit):
        return ""
    least, times = SUSPECTED if stated.slow else UNSTATED
    seconds = max(least, times * found.seconds)
    try:
        name = pilot_solver(scene)
    except ValueError:  # Nothing follows such a start to its end.
        return ""
    first: np.ndarray | None = None
    off = 0.0
    for tolerance in SHARP:
        try:
            run = solve(found.problem, name, tolerance, found.times, max_seconds=seconds)
        except SolverNotValidError:
            return ""
        sharp = form.observe(scene, run.states).slow
        off = float(np.max(np.abs(observables.slow - sharp))) / unit if run.success else 0.0
        if off <= limit or (
            first is not None and np.max(np.abs(first - sharp)) / unit > AGREE * off
        ):
            return ""
        first = sharp
    return f"L or E is off by {scientific(off)} of I_max, as two runs by {name} at {short(SHARP[0])} and tighter agree"
