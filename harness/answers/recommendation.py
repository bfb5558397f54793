"""The answer of `pick`: runs of a scene, the cheapest first, and methods that will not do."""

from dataclasses import asdict, dataclass, field
from functools import cached_property
from html import escape
from itertools import product
from typing import TYPE_CHECKING

from polhode.harness.answers.interval import Interval
from polhode.harness.answers.race import why_not
from polhode.harness.answers.rules import Method
from polhode.harness.common.text import aligned, duration, scientific, short
from polhode.models.catalogue import FORMS, form as find_form
from polhode.models.scene import Scene
from polhode.solvers.catalogue import SOLVERS, solver as find_solver

if TYPE_CHECKING:
    import pandas as pd

# Rows of a ranking that Python's prompt and a notebook show: the first ones matter.
_SHOWN_ROWS = 5
_NOTEBOOK_ROWS = 10


@dataclass(frozen=True)
class RankedRun:
    """One run of a scene, as `polhode solve` takes it."""

    form: str
    solver: str
    tolerance: float
    error: Interval  # of L and E or of the orientation, model error included
    seconds: Interval  # of a run of what is compiled
    first_run_seconds: float  # the same with what this process took to compile
    tied: bool  # whether it is one of several whose times are within `race.TIED` of the first one's
    reason: str  # how error and seconds are known


@dataclass(frozen=True)
class Excluded:
    """A method that will not do, and why."""

    form: str
    solver: str
    reason: str


@dataclass(frozen=True)
class Recommendation:
    """The answer of `pick`."""

    want: str  # "slow" or "orientation"
    error: float  # requested, of L and E over I_max or of the orientation in rad
    rotations: float  # of the scene, about
    damping_times: float  # T max(8πX/I)/St of the scene
    ranking: tuple[RankedRun, ...]  # from the cheapest to the dearest
    refused: tuple[Excluded, ...]  # methods that took part, and will not do
    scene: Scene | None = field(default=None, repr=False)
    seconds: float = 0.0  # what asking took, compilation left out

    @cached_property
    def excluded(self) -> tuple[Excluded, ...]:
        """All methods of the catalogues that are not ranked, and why; without a scene `refused` alone."""
        named = {(row.form, row.solver) for row in (*self.ranking, *self.refused)}
        pairs = list(product(FORMS, SOLVERS)) if self.scene else []
        unranked = [pair for pair in pairs if pair not in named]
        return (*self.refused, *(Excluded(*pair, self._reason(*pair)) for pair in unranked))

    def _reason(self, form: str, solver: str) -> str:
        """Why a method is neither ranked nor refused."""
        assert self.scene
        reason = why_not(self.scene, self.want, Method(find_form(form), find_solver(solver)))
        return reason or "not raced: never the best by far on scenes held out; --all races it"

    @property
    def advice(self) -> str:
        """The command to type instead, if the run is too short to choose for; else nothing."""
        run = self.ranking[0].seconds.predicted
        if run >= self.seconds:
            return ""
        want = "" if self.want == "slow" else f" --want {self.want}"
        return (
            f"Choosing took {duration(self.seconds)}, longer than this run. For a run this short, type "
            f"`polhode solve SCENE --error {short(self.error)}{want}` without asking first: it takes a "
            "method by fixed rules and confirms the error."
        )

    @property
    def summary(self) -> str:
        """The run to choose, in a line, and how far to trust it."""
        first = self.ranking[0]
        tied_count = sum(row.tied for row in self.ranking) - 1
        low = duration(first.seconds.low)
        high = duration(first.seconds.high)
        of = "L and E within {} of I_max" if self.want == "slow" else "orientation within {} rad"
        ties = ""
        if tied_count > 0:
            ties = f"; {tied_count} other{'s' * (tied_count > 1)} tie{'s' * (tied_count == 1)}"
        run = f"{first.form} by {first.solver} at tolerance {short(first.tolerance)}"
        time = f"about {duration(first.seconds.predicted)} ({low} to {high})"
        error = of.format(scientific(first.error.high))
        return f"Run {run}: {time}, {error}{ties}. {self.advice}".strip()

    def __repr__(self) -> str:
        """The run to choose, and the first rows, one a line."""
        rows = [
            (
                row.form,
                row.solver,
                short(row.tolerance),
                scientific(row.error.high),
                duration(row.seconds.predicted),
            )
            for row in self.ranking[:_SHOWN_ROWS]
        ]
        header = ["form", "solver", "tolerance", "error below", "time"]
        return f"{self.summary}\n{aligned(header, rows)}"

    def frame(self) -> "pd.DataFrame":
        """The ranking as a table: a line for each row, intervals in columns of their own, times in seconds."""
        import pandas as pd

        return pd.json_normalize([asdict(row) for row in self.ranking], sep="_")

    def _repr_html_(self) -> str:
        """The summary and a table, for notebooks."""
        return f"<p>{escape(self.summary)}</p>{self.frame().to_html(max_rows=_NOTEBOOK_ROWS)}"
