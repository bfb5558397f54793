"""The page of the stiff side: the fastest implicit solvers, what Jacobian and back end gain, who is stopped.

Equations are stiff where St is small. A run has one body, St, form, solver, back end, Jacobian and tolerance.
The back end `compiled` runs without Python. In the back end `numba`, named after its former compiler, Python
calls back a compiled right-hand side. A Jacobian is `exact` or a `difference` of right-hand sides. The study
is `harness/studies/stiff.toml`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain, product
from math import inf
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

from matplotlib.figure import Figure

from polhode.harness.analysis.frames import frame
from polhode.harness.common.files import write_file
from polhode.harness.common.machine import provenance
from polhode.harness.common.store import Record, write_records
from polhode.harness.common.text import duration, markdown, percent, short
from polhode.harness.pages.figures.style import (
    INK,
    TITLE,
    caption,
    key,
    looks,
    measured,
    panels,
    power,
    rank,
    save,
)
from polhode.harness.pages.figures.work_precision import conditions
from polhode.harness.pages.tables import fill
from polhode.harness.studies.study import Study
from polhode.solvers.contract import Status

# Errors of L and E over I_max at which solvers are compared: loose, middle and tight; a choice.
_ERRORS = (1e-4, 1e-6, 1e-8)
# The error of the figure and of the table of forms: the middle one.
_SHOWN_ERROR = 1e-6
# Fields that the page does not read. The records beside it leave them out.
_LEFT_OUT = (
    "key",
    "errors",
    "model_orientation_error",
    "model_slow_error",
    "solver_orientation_error",
    "solver_slow_error",
    "solver_slow_uncertainty",
    "statistics_distance",
    "statistics_uncertainty",
)
# Forms whose state is angles: one column of the table of forms.
_ANGLES = ("euler-angles", "spheroid-angles")
# Names on the page of back ends that have another one than in the records.
_BACKEND_NAMES = {"numba": "called back"}
# Inches of the figure's height: of its key and the numbers below, and of a body's panel. Chosen by eye.
_FIGURE_MARGIN = 0.5
_PANEL_HEIGHT = 2.6


@dataclass(frozen=True)
class Run:
    """One measured run: what was run, how it ended, its error and its times in seconds."""

    scene: str
    stokes: float
    form: str
    solver: str
    backend: str
    jacobian: str
    tolerance: float
    status: str
    message: str
    error: float | None  # The largest error of L and E, over I_max.
    times: tuple[float, ...]  # Wall times of its repeats, in seconds.

    @classmethod
    def of(cls, record: Record) -> "Run":
        """The run of a record. A failed run has no time, and may have no error."""
        return cls(
            scene=record["scene_name"],
            stokes=record["scene"]["stokes"],
            form=record["form"],
            solver=record["solver"],
            backend=record["backend"],
            jacobian=record["jacobian"],
            tolerance=record["tolerance"],
            status=record["status"],
            message=record["message"],
            error=record.get("slow_error"),
            times=tuple(record.get("seconds_runs") or ()),
        )

    @property
    def reached(self) -> bool:
        """Whether it reached its end and was timed."""
        return self.status == Status.REACHED_END and bool(self.times)

    @property
    def seconds(self) -> float:
        """The least time: what disturbs a run can only lengthen it."""
        return min(self.times)

    def ties(self, other: "Run") -> bool:
        """Whether the lead over a slower run is no larger than what repeats of this run vary by.

        It is a tie if half of the repeats of this run take as long as the fastest one of the other: the lead
        then hangs on a few lucky repeats.
        """
        return median(self.times) >= other.seconds

    def meets(self, error: float) -> bool:
        """Whether it reached its end with an error of at most this."""
        return self.reached and self.error is not None and self.error <= error


def _gains_table(
    runs: Sequence[Run], choice: str, options: tuple[str, str], heads: tuple[str, str, str]
) -> str:
    """The gain of the first of two options over the second, in a row for each solver, as Markdown.

    `choice` is "jacobian" or "backend", `options` are two of its values. `heads` are three headings of columns:
    the other choice, which is equal in both runs; the number of runs that only the first option gets through; the
    number of runs that only the second one gets through.
    """
    beside, only_first, only_second = heads
    return markdown(
        ["solver", beside, "pairs", "median", "least", "most", only_first, only_second],
        [_gain_cells(gain) for gain in gains(runs, choice, options)],
        right=range(2, 8),
    )


def write_page(study: Study, records: Sequence[Record], folder: Path, command: str) -> Path:
    """Write the page, its figure and its records into a folder and return the page's path."""
    folder.mkdir(parents=True, exist_ok=True)
    shared = [
        {name: value for name, value in record.items() if name not in _LEFT_OUT}
        for record in records
    ]
    write_records(shared, folder)
    runs = [Run.of(record) for record in records]
    made = provenance(command, records)
    note = conditions(frame(records), measured(made))
    save(figure(runs, note), folder, "stiff")
    page = fill(
        "stiff",
        title=study.title,
        answers=answers(runs),
        winners=markdown(
            ["body", "St", "error", "fastest", "time", "next solver", "lead"],
            [_winner_cells(winner) for winner in winners(runs)],
            right=(1, 2, 4),
        ),
        error=_SHOWN_ERROR,
        jacobians=_gains_table(
            runs, "jacobian", ("exact", "difference"), ("called", "only exact", "only differenced")
        ),
        backends=_gains_table(
            runs,
            "backend",
            ("compiled", "numba"),
            ("Jacobian", "only compiled", "only called back"),
        ),
        forms=markdown(
            ["body", "St", *_FORMS],
            [_form_cells(row) for row in forms(runs)],
            right=range(1, 2 + len(_FORMS)),
        ),
        tight=min(study.tolerances),
        stopped=stopped(runs, min(study.tolerances)),
        made=made,
    )
    return write_file(folder / "README.md", page)


# --- who wins ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Winner:
    """The fastest run that meets an error on one body at one St, and the fastest one of another solver."""

    scene: str
    stokes: float
    error: float
    run: Run
    other: Run | None

    @property
    def tied(self) -> bool:
        """Whether the lead is no larger than what repeats of the fastest run vary by (`Run.ties`)."""
        return self.other is not None and self.run.ties(self.other)

    @property
    def lead(self) -> float:
        """Time of the other solver over the time of the fastest; NaN if no other one meets the error."""
        return self.other.seconds / self.run.seconds if self.other else float("nan")


def winners(runs: Sequence[Run]) -> list[Winner]:
    """The winner of each body, St and error that some run meets, in any form, back end and Jacobian."""
    winning = []
    places = dict.fromkeys((run.scene, run.stokes) for run in runs)
    for (scene, stokes), error in product(places, _ERRORS):
        place_runs = [run for run in runs if (run.scene, run.stokes) == (scene, stokes)]
        meeting = [run for run in place_runs if run.meets(error)]
        meeting.sort(key=lambda run: run.seconds)
        if meeting:
            fastest = meeting[0]
            other = next((run for run in meeting if run.solver != fastest.solver), None)
            winning.append(Winner(scene, stokes, error, fastest, other))
    return winning


def _winner_cells(winner: Winner) -> list[str]:
    """A row of the table of winners."""
    run = winner.run
    other = winner.other
    lead = "alone" if other is None else f"× {winner.lead:.3g}"
    if winner.tied:
        lead = f"tie ({lead})"
    place = [winner.scene, short(winner.stokes), short(winner.error)]
    return [*place, _named(run), duration(run.seconds), _named(other) if other else "–", lead]


def _named(run: Run) -> str:
    """Solver, form, back end and Jacobian of a run."""
    backend = _BACKEND_NAMES.get(run.backend, run.backend)
    return f"{run.solver}, {run.form} ({backend}, {run.jacobian})"


# --- what a choice gains -----------------------------------------------------------------------------


class _Case(NamedTuple):
    """All that two runs of a pair share: everything but the choice that is compared."""

    solver: str
    beside: str  # The option of the other choice: the back end if Jacobians are compared.
    scene: str
    stokes: float
    form: str
    tolerance: float


@dataclass(frozen=True)
class Gain:
    """The gain of the first of two options over the second, in pairs of runs that differ in nothing else.

    The options are two Jacobians or two back ends. A ratio is the time by the second option over the time by
    the first, of a pair of runs that both reach their end.
    """

    solver: str
    beside: str  # The option of the other choice, which both runs share.
    ratios: list[float]
    gains_most: Run | None  # The run by the first option that has the largest ratio.
    only_first: int  # Pairs of which only the run by the first option reaches its end.
    only_second: int  # Pairs of which only the run by the second option does.

    @classmethod
    def of(cls, solver: str, beside: str, pairs: Sequence[tuple[Run, Run]]) -> "Gain":
        """The gain in pairs of runs, each by the first option and by the second."""
        timed = [(first, second) for first, second in pairs if first.reached and second.reached]
        ratios = [second.seconds / first.seconds for first, second in timed]
        gains_most = timed[ratios.index(max(ratios))][0] if ratios else None
        only_first = sum(first.reached and not second.reached for first, second in pairs)
        only_second = sum(second.reached and not first.reached for first, second in pairs)
        return cls(solver, beside, ratios, gains_most, only_first, only_second)


def gains(runs: Sequence[Run], choice: str, options: tuple[str, str]) -> list[Gain]:
    """The gain of the first option over the second, for each solver and option of the other choice.

    `choice` is "jacobian" or "backend", and `options` are two of its values.
    """
    other_choice = "backend" if choice == "jacobian" else "jacobian"
    by_case: dict[_Case, dict[str, Run]] = {}
    for run in runs:
        beside = getattr(run, other_choice)
        case = _Case(run.solver, beside, run.scene, run.stokes, run.form, run.tolerance)
        by_case.setdefault(case, {})[getattr(run, choice)] = run
    first, second = options
    pairs: dict[tuple[str, str], list[tuple[Run, Run]]] = {}
    for case, by_option in by_case.items():
        if first in by_option and second in by_option:
            pair = by_option[first], by_option[second]
            pairs.setdefault((case.solver, case.beside), []).append(pair)
    rows = []
    for (solver, beside), solver_pairs in pairs.items():
        rows.append(Gain.of(solver, beside, solver_pairs))
    return sorted(rows, key=lambda gain: (rank(gain.solver), gain.beside))


def _gain_cells(gain: Gain) -> list[str]:
    """A row of a table of gains."""
    beside = _BACKEND_NAMES.get(gain.beside, gain.beside)
    ratios = gain.ratios
    median_least_most = ["–"] * 3
    if ratios:
        values = (median(ratios), min(ratios), max(ratios))
        median_least_most = [f"{value:.2g}" for value in values]
    counts = [str(gain.only_first), str(gain.only_second)]
    return [gain.solver, beside, str(len(ratios)), *median_least_most, *counts]


# --- forms -------------------------------------------------------------------------------------------

# Kinds of forms, columns of the table. "angles" are the forms of `_ANGLES`, "axis" is `spheroid-axis`: the
# angular momentum L and the symmetry axis p̂.
_FORMS = ("quaternion", "angles", "axis")


def forms(runs: Sequence[Run]) -> list[tuple[str, float, dict[str, Run]]]:
    """For each body and St the fastest run that meets `_SHOWN_ERROR`, by kind of form: one of `_FORMS`."""
    rows = []
    for scene, stokes in dict.fromkeys((run.scene, run.stokes) for run in runs):
        best: dict[str, Run] = {}
        for run in runs:
            if (run.scene, run.stokes) == (scene, stokes) and run.meets(_SHOWN_ERROR):
                kind = "angles" if run.form in _ANGLES else run.form.removeprefix("spheroid-")
                if kind not in best or run.seconds < best[kind].seconds:
                    best[kind] = run
        rows.append((scene, stokes, best))
    return rows


def _form_cells(row: tuple[str, float, dict[str, Run]]) -> list[str]:
    """A row of the table of forms, of body, St and runs as `forms` gives them."""
    scene, stokes, best = row
    cells = [
        f"{duration(best[kind].seconds)} ({best[kind].solver})" if kind in best else "–"
        for kind in _FORMS
    ]
    return [scene, short(stokes), *cells]


# --- who is stopped ----------------------------------------------------------------------------------


def stopped(runs: Sequence[Run], tolerance: float) -> list[str]:
    """Runs at a tolerance that end with no valid result where another solver or back end does, in lines.

    Runs with an exact Jacobian count. A line has a solver, its back end, the places and the reason that they share.
    """
    compared = [run for run in runs if run.tolerance == tolerance and run.jacobian == "exact"]
    # A place is a body, a St and a form.
    passed = {(run.scene, run.stokes, run.form) for run in compared if run.reached}
    runs_by_place: dict[tuple[str, float, str], list[Run]] = {}
    for run in compared:
        runs_by_place.setdefault((run.scene, run.stokes, run.form), []).append(run)
    # Places in words, by solver, back end and reason.
    places_of: dict[tuple[str, str, str], list[str]] = {}
    for (scene, stokes, form), place_runs in runs_by_place.items():
        if (scene, stokes, form) not in passed:
            continue
        for run in place_runs:
            if run.reached:
                continue
            backend = _BACKEND_NAMES.get(run.backend, run.backend)
            reason = f"{run.status.replace('_', ' ')}: {run.message}".rstrip(": ")
            places = places_of.setdefault((run.solver, backend, reason), [])
            places.append(f"{scene} in {form} at St = {short(stokes)}")
    return [
        f"{solver}, {backend}: {'; '.join(places)} ({reason})"
        for (solver, backend, reason), places in sorted(places_of.items())
    ]


# --- the answer --------------------------------------------------------------------------------------


def answers(runs: Sequence[Run]) -> dict[str, Any]:
    """Numbers of the sentences that begin the page; `texts/stiff.md` has the sentences.

    A cell is a body, a St and an error that some run meets.
    """
    cells = winners(runs)
    by_solver: dict[str, list[Winner]] = {}
    for winner in cells:
        by_solver.setdefault(winner.run.solver, []).append(winner)
    won = []
    for solver in sorted(by_solver, key=lambda name: -len(by_solver[name])):
        won_cells = by_solver[solver]
        won.append(
            {
                "solver": solver,
                "cells": len(won_cells),
                "ties": sum(winner.tied for winner in won_cells),
                "low": min(winner.stokes for winner in won_cells),
                "high": max(winner.stokes for winner in won_cells),
            }
        )
    leads = [winner.lead for winner in cells if winner.other and not winner.tied]
    exact_wins = sum(winner.run.jacobian == "exact" for winner in cells)
    jacobians = gains(runs, "jacobian", ("exact", "difference"))
    backends = gains(runs, "backend", ("compiled", "numba"))
    return {
        "count": len(cells),
        "won": won,
        "leads": median(leads) if leads else None,
        "exact_wins": percent(exact_wins / max(1, len(cells))),
        "by_python": sum(winner.run.backend != "compiled" for winner in cells),
        "exact": _span(jacobians),
        "compiled": _span(backends),
        "worst": _worst(jacobians),
        "only_exact": sum(gain.only_first for gain in jacobians),
        "only_differenced": sum(gain.only_second for gain in jacobians),
    }


def _span(rows: Sequence[Gain]) -> tuple[float, float, float] | None:
    """Median, least and largest ratio of times over all rows; None if there is none."""
    ratios = [*chain.from_iterable(gain.ratios for gain in rows)]
    return (median(ratios), min(ratios), max(ratios)) if ratios else None


def _worst(rows: Sequence[Gain]) -> str:
    """The run by the first option that gains most over the second, in words.

    Empty if no pair has two runs that reach their end.
    """
    gain = max(rows, key=lambda gain: max(gain.ratios, default=0.0), default=None)
    if gain is None or gain.gains_most is None:
        return ""
    run = gain.gains_most
    place = f"{run.scene} in {run.form} at St = {short(run.stokes)}"
    return f"{run.solver}, {place}, tolerance {short(run.tolerance)}"


def figure(runs: Sequence[Run], note: str = "") -> Figure:
    """Time against St for the error shown, by the best form, back end and Jacobian of each solver.

    A solver has no point at a St where no run of it meets the error.
    """
    scenes = list(dict.fromkeys(run.scene for run in runs))
    height = _FIGURE_MARGIN + _PANEL_HEIGHT * len(scenes)
    drawing, grid = panels(len(scenes), 1, height, sharex=True)
    styles = looks(run.solver for run in runs)
    for axes, scene in zip(grid[:, 0], scenes, strict=True):
        scene_runs = [run for run in runs if run.scene == scene and run.meets(_SHOWN_ERROR)]
        for solver, look in styles.items():
            fastest: dict[float, float] = {}
            for run in scene_runs:
                if run.solver == solver:
                    fastest[run.stokes] = min(run.seconds, fastest.get(run.stokes, inf))
            numbers = sorted(fastest)
            milliseconds = [1e3 * fastest[stokes] for stokes in numbers]
            style = {"color": look.colour, "marker": look.marker, "linewidth": 1.2}
            axes.plot(numbers, milliseconds, markersize=5, label=solver, **style)
        # A panel without a point has nothing that a logarithmic axis could hold.
        if scene_runs:
            axes.set(xscale="log", yscale="log")
            # Decades of both axes have one length.
            axes.set_aspect("equal")
        words = f"{scene}, to an error of {power(_SHOWN_ERROR)}"
        axes.set_title(words, fontsize=TITLE, loc="left", color=INK)
        axes.set_ylabel("time, ms")
    grid[-1, 0].set_xlabel("Stokes number St")
    handles, _ = grid[0, 0].get_legend_handles_labels()
    key(drawing, handles, 4)
    caption(drawing, note)
    return drawing
