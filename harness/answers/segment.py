"""A scene or a segment of it that methods are raced on: runs of it, and a confirmed run, the reference."""

from math import inf
from time import thread_time

import numpy as np

from polhode.harness.answers.confirmed import meet
from polhode.harness.answers.fitted import PACED_TOLERANCE
from polhode.harness.answers.forecast import RacedSegment
from polhode.harness.answers.pace import pace, unseen
from polhode.harness.answers.request import NotAttainableError
from polhode.harness.answers.rules import Method, steps_of
from polhode.harness.answers.runs import MAX_STEPS, Run, Runner, Watch
from polhode.harness.answers.statement import INNER, NO_ERROR, difference
from polhode.models.form import Form
from polhode.models.observables import Observables
from polhode.models.scene import Scene
from polhode.models.spent import SPENT
from polhode.solvers.contract import UNLIMITED

# Largest predicted error of a reference, as a share of the error that a method may have on the segment. The rest is
# left to the methods. An estimate.
KNOWN_SHARE = 0.5
# A difference that grows by a larger power of time tells of chaos: without chaos the power is 2 at
# most, the orientation's (`forecast.RacedSegment.growth`). The margin is an estimate.
_MOST_GROWTH = 4.0
# Steps up to which the look ahead of a form, some ms, counts beside its run. An estimate: a run of more steps takes
# as long as the look ahead, or longer.
_FEW_STEPS = 10_000
# Index in `INNER`, the compared times, of the middle of a segment.
_MIDDLE = int(np.searchsorted(INNER, 0.5))


def in_tables(form: Form) -> bool:
    """Whether a form averages to second order: it looks ahead along a run, and needs tables of a triaxial shape."""
    return form.name in ("averaged-second-order", "hybrid")


class Remembering(Runner):
    """A runner that makes no successful run twice, and keeps the runs' processor seconds."""

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene, INNER * scene.time)
        self.runs: dict[tuple[Method, float], Run] = {}
        self.seconds: dict[tuple[Method, float], float] = {}
        self.cold_runs = 0

    def run(
        self, method: Method, tolerance: float, max_steps: int = UNLIMITED, watch: Watch = None
    ) -> Run:
        """Run a method, or return its successful run, whatever `max_steps` is.

        Seconds of compilation are known by wall time alone: beside other work too many are taken off.
        """
        key = method, tolerance
        if key not in self.runs or not self.runs[key].success:
            compiled = SPENT.seconds["compilation"]
            began = thread_time()
            run = super().run(method, tolerance, max_steps, watch)
            compilation = SPENT.seconds["compilation"] - compiled
            self.seconds[key] = thread_time() - began - compilation
            self.runs[key] = run
        return self.runs[key]

    def paid(self, run: Run, samples: int) -> float:
        """Seconds of a run at `samples` rows, from the scene to its observables.

        The problem is made once for each form: its first run alone pays for that.
        """
        seconds = self.seconds[run.method, run.tolerance]
        if in_tables(run.method.form) and run.steps < _FEW_STEPS:
            # The form may have looked ahead along this scene before: a run of another one pays for that too.
            self.cold_runs += 1
            cold = Remembering(unseen(self.scene, self.cold_runs))
            cold.run(run.method, run.tolerance)
            seconds = cold.seconds[run.method, run.tolerance]
        row = pace(run.method, run.tolerance).row
        return max(0.0, seconds + row * (samples - len(self.times)))


class Segment:
    """The segment that methods are raced on, and a confirmed run of it, the reference."""

    def __init__(self, raced: RacedSegment, usual: Method, error: float, want: str) -> None:
        self.raced = raced
        self.usual = usual
        self.want = want
        # The error on the segment that a method may have, so that the run's is below the one requested.
        self.budget = error / raced.growth(want) / raced.spread
        self.runner = Remembering(raced.scene)
        self.reference: Observables | None = None
        # Predicted error of the usual run, whether or not it becomes the reference, and the error's upper end.
        self.apart = inf
        self.most = inf
        self.looked = False  # Whether the reference has been looked for.

    def find_reference(self) -> None:
        """Run the usual method until its error is confirmed.

        A chaotic segment forecasts nothing: then the scene itself is run, however long. If the segment has no
        reference, the scene is run only if it is short.
        """
        if self.looked:
            return
        self.looked = True
        growth = self._confirm()
        if self.raced.whole or (self.reference and growth <= _MOST_GROWTH):
            return
        whole = self.raced.of_the_whole()
        steps = steps_of(whole.scene, self.usual, PACED_TOLERANCE)
        if self.reference or steps <= MAX_STEPS:
            self.budget *= self.raced.growth(self.want) * self.raced.spread / whole.spread
            self.raced = whole
            self.runner = Remembering(whole.scene)
            self._confirm()

    def _confirm(self) -> float:
        """Look for the reference; the power of time with which the difference of its two runs grows.

        The power is log2 of the largest difference in the run over the largest in its first half. It is 0
        where the usual method fails, states no error, or cannot attain the one requested.
        """
        self.reference = None
        self.apart = inf
        self.most = inf
        try:
            answer = meet(self.runner, [self.usual], self.budget, self.want)
        except NotAttainableError:
            return 0.0
        interval = answer.error.of(self.want)
        if not (interval and answer.solution.success):
            return 0.0
        self.apart = interval.predicted
        self.most = interval.high
        if self.apart <= KNOWN_SHARE * self.budget:
            form = answer.method.form
            self.reference = form.observe(self.raced.scene, answer.solution.states)
        values = getattr(answer.error.difference, self.want)
        in_first_half = max(float(values[: _MIDDLE + 1].max()), NO_ERROR)
        in_all = max(float(values.max()), NO_ERROR)
        return float(np.log2(in_all / in_first_half))

    def error(self, run: Run) -> float:
        """The error of a run on the segment, of L and E or of the orientation."""
        assert self.reference
        ellipsoid = self.raced.scene.ellipsoid
        return difference(ellipsoid, run.observables, self.reference).largest.get(self.want, inf)
