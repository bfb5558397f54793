"""What `pick` answers: ways to run a scene, from the cheapest to the dearest, and those that will not do."""

from dataclasses import asdict, dataclass
from html import escape
from math import inf
from typing import TYPE_CHECKING

from polhode.harness.answers.interval import Interval
from polhode.harness.common.text import aligned, duration, scientific, short
from polhode.models.scene import Scene

if TYPE_CHECKING:
    import pandas as pd

# Stokes numbers between 0 and inf, and shortest over longest semi-axes, of the scenes that laws are
# fitted to.
FITTED_STOKES, FITTED_RATIO = (1e-4, 1e8), 0.1


@dataclass(frozen=True)
class Way:
    """One way to run a scene, as `polhode solve` takes it."""

    form: str
    solver: str
    tolerance: float
    error: Interval  # predicted, of the kind wanted, model error included
    seconds: Interval  # predicted, of a warm run
    first_run_seconds: float  # the same with the compilation that a first run in a process pays
    tied: bool  # whether there are others whose intervals of time overlap with the first one's, and it is of those
    reason: str


@dataclass(frozen=True)
class Excluded:
    """A way that will not do, and why."""

    form: str
    solver: str
    reason: str


def outside_of_fit(scene: Scene) -> str:
    """That laws were fitted to other scenes, in a sentence, where they were."""
    (least, most), ratio = FITTED_STOKES, min(scene.ellipsoid.scaled_axes)
    if (scene.stokes in (0, inf) or least <= scene.stokes <= most) and ratio >= FITTED_RATIO:
        return ""
    fitted = f"St from {short(least)} to {short(most)} and semi-axes of at least {FITTED_RATIO} of the longest"
    return f"Laws were fitted to {fitted}, here St = {short(scene.stokes)} and {short(ratio)}: they may be far off."


@dataclass(frozen=True)
class Recommendation:
    """What `pick` answers."""

    want: str
    error: float
    rotations: float  # N = ∫|ω|dt/2π of the scene
    damping_times: float  # T max(8πX/I)/St of the scene
    ranking: tuple[Way, ...]  # from the cheapest to the dearest
    excluded: tuple[Excluded, ...]
    outside: str = ""  # that the laws were fitted to other scenes, where they were

    @property
    def summary(self) -> str:
        """What to run, in a line, and how far to trust it."""
        first, others = self.ranking[0], sum(way.tied for way in self.ranking) - 1
        low, high = duration(first.seconds.low), duration(first.seconds.high)
        of = "L and E within {} of I_max" if self.want == "slow" else "orientation within {} rad"
        ties = (
            f"; {others} other{'s' * (others > 1)} tie{'s' * (others == 1)}" if others > 0 else ""
        )
        way = f"{first.form} by {first.solver} at tolerance {short(first.tolerance)}"
        time = f"about {duration(first.seconds.predicted)} ({low} to {high})"
        return f"Run {way}: {time}, {of.format(scientific(first.error.high))}{ties}. {self.outside}".strip()

    def __repr__(self) -> str:
        """What to run, and the first ways, one a line."""
        rows = [
            (
                way.form,
                way.solver,
                short(way.tolerance),
                scientific(way.error.high),
                duration(way.seconds.predicted),
            )
            for way in self.ranking[:5]
        ]
        return f"{self.summary}\n{aligned(['form', 'solver', 'tolerance', 'error below', 'time'], rows)}"

    def frame(self) -> "pd.DataFrame":
        """The ranking as a table: a row for each way, intervals in columns of their own, times in seconds."""
        import pandas as pd

        return pd.json_normalize([asdict(way) for way in self.ranking], sep="_")

    def _repr_html_(self) -> str:
        """What notebooks show."""
        return f"<p>{escape(self.summary)}</p>{self.frame().to_html(max_rows=10)}"
