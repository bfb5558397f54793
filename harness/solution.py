"""The motion of a scene: what `solve` returns."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from html import escape
from itertools import product
from math import nan
from operator import attrgetter
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from polhode.harness.answers.statement import UNKNOWN, RunError
from polhode.harness.common.files import dumps
from polhode.harness.common.machine import versions
from polhode.harness.common.text import scientific, short
from polhode.models.form import Form
from polhode.models.former import Former
from polhode.models.libraries import need
from polhode.models.observables import Observables, angular_velocity
from polhode.models.scene import Scene, start_from
from polhode.models.shape import require_numbers
from polhode.solvers.contract import Status
from polhode.solvers.dense_output import LikeSolveIvp, times_within
from polhode.solvers.segments import SolvedSegment
from polhode.solvers.solve import Solution, described

if TYPE_CHECKING:
    from os import PathLike

    import pandas as pd
    import xarray as xr
    from numpy.typing import ArrayLike

# Rows that `write_csv` writes between two reports of its progress. An estimate: fewer
# rows only report more often.
_ROWS_PER_NOTE = 10_000
# Columns of CSV files and frames: the time, the slow time, L in space axes, E, and the rotation matrix,
# whose rows are body axes in space.
COLUMNS = ["t", "t2", "Lx", "Ly", "Lz", "E"]
COLUMNS += [f"R{i}{j}" for i, j in product((1, 2, 3), repeat=2)]
# On demand: ω in space axes.
OMEGA = ["wx", "wy", "wz"]
# Lines about segments in a printed solution: an estimate of what is still read.
_SHOWN_SEGMENTS = 8


@dataclass(frozen=True)
class SceneSolution(LikeSolveIvp):
    """The motion of a scene, finished or not; it pickles.

    Called with times, a number or an array in units of the inverse shear rate, it gives the motion
    there, again a `SceneSolution`. The run's solver, or one of order 8 for it, integrates from the row before
    each time at the run's tolerance: one step's error is added to the row's. A solution has the names of `solve_ivp`'s
    result too: `t`, `y` (the form's own state, shape (d, n)), `sol`, `nfev`, `njev`, `status`,
    `message`, `success`.

    Parameters
    ----------
    scene : Scene
    equations : Form
        The form that was solved.
    run : Solution
        Of the form's problem, in the problem's own time: states, status, work.
    times : ndarray, shape (n,)
        In units of the inverse shear rate.
    observables : Observables
        L, E and the rotation matrix at these times.
    error : RunError
        Estimated for this very run: `slow`, of L and E over I_max, and `orientation`, in rad.
    events : dict
        By name, the motion at the times at which a requested event happened.
    """

    scene: Scene
    equations: Form
    run: Solution
    times: np.ndarray
    observables: Observables
    error: RunError = UNKNOWN
    events: Mapping[str, "SceneSolution"] = field(default_factory=dict)

    def __call__(self, t: "ArrayLike") -> "SceneSolution":
        """The motion at other times of the run, shape (k,) or a number; ValueError if one lies outside the run."""
        times = times_within(self, t)
        # The run counts in its own unit of time. `interp` gives a row's time exactly, so that the motion there
        # is the row's.
        return self.at(times, self.run(np.interp(times, self.times, self.run.times)))

    def at(self, times: np.ndarray, run: Solution) -> "SceneSolution":
        """The motion for a run with other rows, whose times, shape (k,), are given in the scene's unit."""
        observables = self.equations.observe(self.scene, run.states)
        error = self.error.at(times / self.scene.time)
        return replace(self, times=times, run=run, observables=observables, error=error)

    def rows(self, which: slice | np.ndarray) -> "SceneSolution":
        """The motion at some of the rows: a slice, or an array of indices or of booleans."""
        return self.at(
            self.times[which],
            replace(self.run, times=self.run.times[which], states=self.states[which]),
        )

    def until(self, end: "SceneSolution") -> "SceneSolution":
        """The motion up to the one row of `end`, with which it counts as finished.

        A run that is known to be wrong stays a false success.
        """
        before = self.times < end.times[0]
        states = np.vstack([self.states[before], end.states])
        times = np.append(self.run.times[before], end.run.times)
        run = replace(self.run, times=times, states=states)
        if run.status is not Status.FALSE_SUCCESS:
            run = replace(run, status=Status.REACHED_END, message="")
        return self.at(np.append(self.times[before], end.times), run)

    def __repr__(self) -> str:
        """One fact a line, without the arrays."""
        problem = f"{self.form}, St = {short(self.scene.stokes)}, to t = {short(self.scene.time)}"
        lines = [described(self, problem, f"tolerance {short(self.tolerance)}")]
        if self.error is not UNKNOWN:
            lines.append(f"  error: {self.error.words()}")
        lines += [f"  segment: {words}" for words in self.segments_in_words()]
        return "\n".join([*lines, *[f"  advice: {self.error.advice}"] * bool(self.error.advice)])

    def _repr_html_(self) -> str:
        """The same facts as a table, for notebooks."""
        facts = (line.strip().split(": ", 1) for line in repr(self).splitlines()[1:])
        rows = "".join(
            f"<tr><th>{escape(name)}</th><td>{escape(fact)}</td></tr>" for name, fact in facts
        )
        return f"<table><caption>{type(self).__name__}</caption>{rows}</table>"

    @property
    def segments(self) -> tuple[SolvedSegment, ...]:
        """Segments of a run of several, with begin and end in slow time; empty if the run has one alone."""
        # The run's unit of time in units of the slow time.
        unit = self.run.problem.time_unit / self.scene.stokes if self.run.segments else 1.0
        return tuple(
            replace(segment, begin=unit * segment.begin, end=unit * segment.end)
            for segment in self.run.segments
        )

    def segments_in_words(self, most: int = _SHOWN_SEGMENTS) -> list[str]:
        """The segments, one a line, in at most `most` lines; the last one counts those that are left out, if any."""
        lines = [
            f"t₂ = {segment.begin:.3g} to {segment.end:.3g}: {segment.reason}"
            f"{'' if segment.averaged else ', full equations'}, error below {scientific(segment.error)}"
            for segment in self.segments
        ]
        return (
            lines
            if len(lines) <= most
            else [*lines[: most - 1], f"{len(lines) - most + 1} segments more"]
        )

    # Names of version 0.1, which warn.
    pieces = Former("segments")
    pieces_in_words = Former("segments_in_words")

    form = property(attrgetter("equations.name"), doc="Name of the form.")
    solver = property(attrgetter("run.solver"), doc="Name of the solver.")
    tolerance = property(attrgetter("run.settings.tolerance"), doc="The solver's.")
    status = property(
        attrgetter("run.status"),
        doc="How the run ended; after a failure there are the rows before it.",
    )
    message = property(attrgetter("run.message"), doc="Why it failed, in the library's own words.")
    work = property(attrgetter("run.work"), doc="What the run cost.")
    seconds = property(
        attrgetter("run.seconds"), doc="Wall time of the integrator alone, compilation left out."
    )
    states = property(
        attrgetter("run.states"),
        doc="The form's own variables, (n, d); `equations.state_of(scene)` names them.",
    )
    angular_momentum = property(
        attrgetter("observables.angular_momentum"), doc="L in space axes, (n, 3), without St."
    )
    energy = property(attrgetter("observables.energy"), doc="E, shape (n,), without St.")
    rotation = property(
        attrgetter("observables.rotation"),
        doc="(n, 3, 3), rows: body axes in space; NaN if unknown.",
    )

    @property
    def slow_times(self) -> np.ndarray:
        """t₂ = t/St, shape (n,): NaN at St = 0, 0 at St = inf."""
        return (
            np.full_like(self.times, nan)
            if self.scene.stokes == 0
            else self.times / self.scene.stokes
        )

    @property
    def angular_velocity(self) -> np.ndarray:
        """ω in space axes, shape (n, 3), in units of the shear rate; NaN where the form knows no orientation."""
        return angular_velocity(self.scene.ellipsoid, self.observables)

    def table(self, omega: bool = False) -> np.ndarray:
        """`frame` as an array of its columns, shape (n, 15), or (n, 18) with the angular velocity."""
        rotation = self.rotation.reshape(len(self.times), 9)
        more = [self.angular_velocity] if omega else []
        return np.column_stack(
            [self.times, self.slow_times, self.observables.slow, rotation, *more]
        )

    def frame(self, omega: bool = False) -> "pd.DataFrame":
        """One row per time, with the columns of `polhode solve`'s CSV: t, t2, Lx, Ly, Lz, E, R11 … R33.

        With `omega` the angular velocity in space axes stands behind them: wx, wy, wz. Its `attrs`
        are `provenance`.
        """
        import pandas as pd

        table = pd.DataFrame(self.table(omega), columns=COLUMNS + OMEGA * omega)
        table.attrs.update(self.provenance())
        return table

    def provenance(self) -> dict[str, Any]:
        """The origin of the numbers, as plain data: scene, form, solver, tolerance, versions; and how the run went."""
        from polhode.models.files.scene_file import scene_table

        names = ("form", "solver", "tolerance", "seconds")
        segments = [asdict(segment) for segment in self.segments]
        return {
            "scene": scene_table(self.scene),
            **{name: getattr(self, name) for name in names},
            "status": str(self.status),
            "error": self.error.summary(),
            "segments": segments,
            # The key of version 0.1, for version 0.2 too.
            "pieces": segments,
            "versions": versions(),
        }

    def to_parquet(self, path: "str | PathLike[str]", omega: bool = False) -> None:
        """Write `frame` as Parquet; `MissingLibraryError` without pyarrow."""
        need("to_parquet", "pyarrow")
        self.frame(omega).to_parquet(path)

    def to_xarray(self) -> "xr.Dataset":
        """L, E, rotation matrix and ω over t; body axes count from 1. `MissingLibraryError` without xarray."""
        need("to_xarray", "xarray")
        import xarray as xr

        return xr.Dataset(
            {
                "L": (("t", "space"), self.angular_momentum),
                "E": ("t", self.energy),
                "R": (("t", "body", "space"), self.rotation),
                "omega": (("t", "space"), self.angular_velocity),
            },
            {
                "t": self.times,
                "t2": ("t", self.slow_times),
                "space": ["x", "y", "z"],
                "body": [1, 2, 3],
            },
            # Numbers and text alone can be written to any file.
            {
                name: dumps(value) if isinstance(value, dict | list) else value
                for name, value in self.provenance().items()
            },
        )

    def restart(self, t: float | None = None, time: float | None = None) -> Scene:
        """The scene that goes on from a time of this motion, for one more run or for a scene file.

        Parameters
        ----------
        t : float, optional
            Where it starts; by default the last time reached.
        time : float, optional
            Its duration; by default what remains of the scene's, or all of it again where nothing
            remains.

        Raises
        ------
        ValueError
            If t lies outside the run.

        Notes
        -----
        The motion of a spheroid does not depend on the angle about its symmetry axis: a form that
        knows that axis alone leaves the angle open.
        """
        last = float(self.times[-1]) if t is None else t
        require_numbers("t", last)
        start = start_from(self.scene.ellipsoid, self(last).observables)
        time = self.scene.time - last or self.scene.time if time is None else time
        return self.scene.later(last, start, time)


def write_csv(file: IO[str], table: np.ndarray, advance: Callable[[float], None]) -> None:
    """Write a table, shape (n, 15) or (n, 18), under `COLUMNS` and, if it has them, `OMEGA`.

    `advance` hears which share of the rows is written: above 0, and 1 at the end.
    """
    file.write(",".join([*COLUMNS, *OMEGA][: table.shape[1]]) + "\n")
    for first in range(0, len(table), _ROWS_PER_NOTE):
        rows = table[first : first + _ROWS_PER_NOTE].tolist()
        file.writelines(map(_line, rows))
        advance((first + len(rows)) / len(table))


def _line(row: list[float]) -> str:
    """One line of CSV, NaN as an empty cell."""
    # 17 significant digits are as many as give a double back to the last bit.
    return ",".join("" if x != x else f"{x:.17g}" for x in row) + "\n"
