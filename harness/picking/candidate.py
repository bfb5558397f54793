"""A form by a solver on a scene: the tolerance that laws promise or give hope of, and what it will take."""

from contextlib import suppress
from dataclasses import dataclass, replace
from math import exp, log10

from polhode.harness.answers.interval import Interval
from polhode.harness.common.text import scientific
from polhode.harness.picking.laws import ErrorLaw, Load, MethodLaws, Sensitivity
from polhode.harness.picking.load import load_of
from polhode.harness.picking.model_error import causes
from polhode.harness.picking.pilot import InPieces, Pilot, PilotFailedError, averages
from polhode.harness.picking.recommendation import Way
from polhode.harness.picking.refusals import (
    Stage,
    UnfitError,
    one_digit,
    one_digit_up,
    too_far_off,
    too_tight,
)
from polhode.models.form import Form
from polhode.solvers.catalogue import solver as find_solver
from polhode.solvers.contract import Work

# Laws were fitted between these tolerances.
LOOSEST, TIGHTEST = 1e-3, 1e-15
# So much tighter than its tightest measured run a method may be asked to be.
BEYOND = 1e3
# An averaged form whose model error leaves its solver less than this share of the error asked for
# is not expected to meet it.
SHARE = 0.05


@dataclass(frozen=True, eq=False)
class Candidate:
    """A method that takes a scene: its laws, and what its solver may err by, beside a model error."""

    form: Form
    solver: str
    laws: MethodLaws
    law: ErrorLaw
    at: Sensitivity
    budget: float
    model: Interval | None
    found: Pilot
    samples: int

    @property
    def tightest(self) -> float:
        """The tightest tolerance that it may be asked for."""
        return max(TIGHTEST, self.laws.tightest / BEYOND)

    @property
    def asked(self) -> float:
        """The error asked for."""
        return self.budget + (self.model.high if self.model else 0.0)

    @property
    def doubtful(self) -> bool:
        """Whether the model error may be too large: a trial against the full equations shows."""
        return self.budget < SHARE * self.asked

    @property
    def states_its_error(self) -> bool:
        """Whether a run says itself what it errs by."""
        return isinstance(self.form, InPieces) and find_solver(self.solver).wears > 0

    def worse(self, factor: float) -> "Candidate":
        """The same, whose errors at every tolerance are so many times what its law says."""
        return replace(self, law=replace(self.law, offset=self.law.offset + log10(factor)))

    def expected(self) -> Way:
        """The way to run it by its laws alone; raises UnfitError if no tolerance will do."""
        if self.model and self.doubtful:
            raise too_far_off(self.model.high, self.asked, SHARE, causes(self.form, self.found))
        tolerance = self._tolerance(self.law.stray.high)
        if tolerance < self.tightest:
            raise too_tight(self.law, self.at, one_digit_up(self.tightest), self.asked, self.budget)
        own = self.law.predict(self.at, tolerance)
        return self.way(tolerance, own, f"97.5 % of like runs stay below {scientific(own.high)}")

    def hoped(self, lucky: bool = True) -> Way | None:
        """The way to run it if it errs as the middle one of like scenes does, or rounds as the luckiest one."""
        if self.doubtful:
            return replace(self, budget=SHARE * self.asked, model=None).hoped()
        tolerance, stray = self._tolerance(self.law.stray.middle), self.law.stray
        if (
            lucky
            and tolerance < self.tightest
            and self.law.rounding(self.at) * exp(stray.low) < self.budget
        ):
            tolerance = replace(self, law=replace(self.law, floor=0.0))._tolerance(stray.middle)
        return None if tolerance < self.tightest else self.by_law(tolerance)

    def by_law(self, tolerance: float) -> Way | None:
        """The way to run it at a tolerance, if its pilots do not fail."""
        with suppress(PilotFailedError, UnfitError):
            return self.way(tolerance, self.law.predict(self.at, tolerance), "")
        return None

    def _tolerance(self, stray: float) -> float:
        return one_digit(min(LOOSEST, self.law.tolerance(self.at, self.budget, stray)))

    def way(self, tolerance: float, own: Interval, error: str, work: Work | None = None) -> Way:
        """The method at a tolerance, with its solver's own error, what is known of it in words, and a trial's work."""
        if work and work.steps and find_solver(self.solver).many_periods:
            load = Load(work.steps + (work.rejected or 0), work.inner or 0, 0.0, self.samples)
        else:
            load = load_of(self.form, self.solver, self.found, self.samples, tolerance)
            load = replace(load, steps=work and work.steps)
        if load.pieces and not self.laws.cost.per_piece:
            raise UnfitError("no law: not measured with pieces that average", Stage.LAW)
        seconds = self.laws.cost.predict(load, tolerance)
        first_run = self.laws.compile_seconds + seconds.predicted
        whole = own.plus(self.model) if self.model else own
        return Way(
            self.form.name,
            self.solver,
            tolerance,
            whole,
            seconds,
            first_run,
            False,
            self._reason(error),
        )

    def _reason(self, error: str) -> str:
        if find_solver(self.solver).closed_form:
            return "closed form: neither time nor tolerance matter"
        if self.form.averaged:
            known = f"model error {scientific(self.model.predicted)}" if self.model else error
            return f"averaged: costs the same at every St; {known}"
        if self.found.stiff:
            return f"implicit: {self.found.damping_times:.2g} damping times would hold an explicit method back; {error}"
        how = (
            "full equations"
            if not averages(self.form)
            else "averages where these hold, full equations elsewhere,"
        )
        return f"{how} over {self.found.rotations:.3g} rotations; {error}"
