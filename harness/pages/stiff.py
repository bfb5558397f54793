"""The page of the stiff side: the fastest implicit solvers, what Jacobian and back end gain, who is stopped.

The stiff side is that of small St. A run is one body, St, form, solver, back end, Jacobian and tolerance. The
back end `compiled` runs without Python; by `numba` Python calls back a compiled right-hand side, and has the
name of its former compiler. A Jacobian is `exact` or by a `difference` of right-hand sides. The study is
`harness/studies/stiff.toml`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from statistics import median
from typing import Any

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

# Errors of L and E over I_max at which solvers are compared: loose, middle and tight.
_ERRORS = (1e-4, 1e-6, 1e-8)
# The error of the figure and of the table of forms: the middle one.
_SHOWN_ERROR = 1e-6
# Fields that the page does not read. The records beside it leave them out: there are 1500.
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
    error: float | None  # Largest of L and E, over I_max.
    times: tuple[float, ...]

    @classmethod
    def of(cls, record: Record) -> "Run":
        """The run of a record, whose time is absent and whose error may be if it failed."""
        return cls(
            record["scene_name"],
            record["scene"]["stokes"],
            record["form"],
            record["solver"],
            record["backend"],
            record["jacobian"],
            record["tolerance"],
            record["status"],
            record["message"],
            record.get("slow_error"),
            tuple(record.get("seconds_runs") or ()),
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
    runs: Sequence[Run], choice: str, pair: tuple[str, str], heads: tuple[str, str, str]
) -> str:
    """The gain of the first option of `pair` over the second, in a row for each solver.

    `choice` is "jacobian" or "backend". `heads` are headings: of the column of the choice that is held equal, and
    of the counts of runs that only the first option, and only the second one, gets through.
    """
    beside, only_first, only_second = heads
    return markdown(
        ["solver", beside, "pairs", "median", "least", "most", only_first, only_second],
        [_pair_cells(gain) for gain in gains(runs, choice, pair)],
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
    first = [_winner_cells(found) for found in winners(runs)]
    page = fill(
        "stiff",
        title=study.title,
        answers=answers(runs),
        winners=markdown(
            ["body", "St", "error", "fastest", "time", "next solver", "lead"],
            first,
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
            ["body", "St", *_FORMS], [_form_cells(row) for row in forms(runs)], right=range(1, 6)
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
        """Whether the lead is within the runs' own spread."""
        return self.other is not None and self.run.ties(self.other)

    @property
    def lead(self) -> float:
        """Time of the other solver over the fastest's; NaN if no other gets there."""
        return self.other.seconds / self.run.seconds if self.other else float("nan")


def winners(runs: Sequence[Run]) -> list[Winner]:
    """The winner of each body, St and error that some run meets, in any form, back end and Jacobian."""
    found = []
    places = dict.fromkeys((run.scene, run.stokes) for run in runs)
    for (scene, stokes), error in product(places, _ERRORS):
        here = [
            run for run in runs if (run.scene, run.stokes) == (scene, stokes) and run.meets(error)
        ]
        here.sort(key=lambda run: run.seconds)
        if here:
            other = next((run for run in here if run.solver != here[0].solver), None)
            found.append(Winner(scene, stokes, error, here[0], other))
    return found


def _winner_cells(winner: Winner) -> list[str]:
    run = winner.run
    other = winner.other
    lead = "alone" if other is None else f"× {winner.lead:.3g}"
    if winner.tied:
        lead = f"tie ({lead})"
    place = [winner.scene, short(winner.stokes), short(winner.error)]
    return [*place, _named(run), duration(run.seconds), _named(other) if other else "–", lead]


def _named(run: Run) -> str:
    called = "compiled" if run.backend == "compiled" else "called back"
    return f"{run.solver}, {run.form} ({called}, {run.jacobian})"


# --- what a choice gains -----------------------------------------------------------------------------


@dataclass(frozen=True)
class Pair:
    """Times of two options of a choice, in pairs of runs that differ in nothing else.

    The choice is the Jacobian or the back end. A pair of runs has one solver, body, St, form and tolerance.
    """

    solver: str
    beside: str  # The other one of the two choices, which both runs share.
    ratios: list[float]  # Time by the second option over that by the first.
    longest: Run | None  # The first one's run with the largest ratio.
    only_first: int  # Runs that only the first choice gets through.
    only_second: int


def gains(runs: Sequence[Run], choice: str, names: tuple[str, str]) -> list[Pair]:
    """Time by the second option over that by the first, for each solver and value of the other choice.

    `choice` is "jacobian" or "backend", and `names` are two of its options.
    """
    beside = "backend" if choice == "jacobian" else "jacobian"
    pairs: dict[tuple[str, str], Pair] = {}
    # Runs that differ in the choice alone stand together, each under its option.
    by_choice: dict[tuple[Any, ...], dict[str, Run]] = {}
    for run in runs:
        own = getattr(run, beside)
        key = run.solver, own, run.scene, run.stokes, run.form, run.tolerance
        by_choice.setdefault(key, {})[getattr(run, choice)] = run
    for (solver, own, *_), found in by_choice.items():
        if set(names) <= set(found):
            first, second = (found[name] for name in names)
            pair = pairs.setdefault((solver, own), Pair(solver, own, [], None, 0, 0))
            longest = pair.longest
            if first.reached and second.reached:
                ratio = second.seconds / first.seconds
                if ratio > max(pair.ratios, default=0.0):
                    longest = first
                pair.ratios.append(ratio)
            one = pair.only_first + (first.reached and not second.reached)
            two = pair.only_second + (second.reached and not first.reached)
            pairs[solver, own] = Pair(solver, own, pair.ratios, longest, one, two)
    return sorted(pairs.values(), key=lambda pair: (rank(pair.solver), pair.beside))


def _pair_cells(pair: Pair) -> list[str]:
    beside = {"numba": "called back"}.get(pair.beside, pair.beside)
    if not pair.ratios:
        sizes = ["–"] * 3
    else:
        sizes = [
            f"{value:.2g}" for value in (median(pair.ratios), min(pair.ratios), max(pair.ratios))
        ]
    return [
        *(pair.solver, beside, str(len(pair.ratios)), *sizes),
        *(str(pair.only_first), str(pair.only_second)),
    ]


# --- forms -------------------------------------------------------------------------------------------

# Kinds of forms, columns of the table; "axis" is the form (L, p̂) of a spheroid.
_FORMS = ("quaternion", "angles", "axis")


def forms(runs: Sequence[Run]) -> list[tuple[str, float, dict[str, Run]]]:
    """The fastest run in each kind of form that meets the error shown, by body and St."""
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
    scene, stokes, best = row
    cells = [
        f"{duration(best[kind].seconds)} ({best[kind].solver})" if kind in best else "–"
        for kind in _FORMS
    ]
    return [scene, short(stokes), *cells]


# --- who is stopped ----------------------------------------------------------------------------------


def stopped(runs: Sequence[Run], tolerance: float) -> list[str]:
    """In a line each: solvers with an exact Jacobian that a scene stopped at a tolerance which another one met."""
    tight = [run for run in runs if run.tolerance == tolerance and run.jacobian == "exact"]
    lines: dict[tuple[str, str, str], list[str]] = {}
    for scene, stokes, form in dict.fromkeys((run.scene, run.stokes, run.form) for run in tight):
        here = [run for run in tight if (run.scene, run.stokes, run.form) == (scene, stokes, form)]
        if any(run.reached for run in here):
            for run in here:
                if not run.reached:
                    called = "compiled" if run.backend == "compiled" else "called back"
                    why = f"{run.status.replace('_', ' ')}: {run.message}".rstrip(": ")
                    key = run.solver, called, why
                    lines.setdefault(key, []).append(f"{scene} in {form} at St = {short(stokes)}")
    return [
        f"{solver}, {called}: {'; '.join(places)} ({why})"
        for (solver, called, why), places in sorted(lines.items())
    ]


# --- the answer --------------------------------------------------------------------------------------


def answers(runs: Sequence[Run]) -> dict[str, Any]:
    """Numbers of the sentences that begin the page; `texts/stiff.md` has the sentences.

    A cell is a body, a St and an error that some run meets.
    """
    found = winners(runs)
    won: dict[str, list[Winner]] = {}
    for winner in found:
        won.setdefault(winner.run.solver, []).append(winner)
    order = sorted(won, key=lambda name: -len(won[name]))
    jacobians = gains(runs, "jacobian", ("exact", "difference"))
    backends = gains(runs, "backend", ("compiled", "numba"))
    by_python = [winner.run.backend != "compiled" for winner in found]
    return {
        "count": len(found),
        "won": [
            {
                "solver": name,
                "cells": len(won[name]),
                "ties": sum(winner.tied for winner in won[name]),
                "low": min(winner.stokes for winner in won[name]),
                "high": max(winner.stokes for winner in won[name]),
            }
            for name in order
        ],
        "leads": median(winner.lead for winner in found if winner.other and not winner.tied)
        if any(winner.other and not winner.tied for winner in found)
        else None,
        "exact_wins": percent(sum(winner.run.jacobian == "exact" for winner in found) / len(found)),
        "by_python": sum(by_python),
        "exact": _span(jacobians),
        "compiled": _span(backends),
        "worst": _worst(jacobians),
        "only_exact": sum(pair.only_first for pair in jacobians),
        "only_differenced": sum(pair.only_second for pair in jacobians),
    }


def _span(pairs: Sequence[Pair]) -> tuple[float, float, float] | None:
    """Median, least and largest ratio; None if there is none."""
    ratios = [ratio for pair in pairs for ratio in pair.ratios]
    return (median(ratios), min(ratios), max(ratios)) if ratios else None


def _worst(pairs: Sequence[Pair]) -> str:
    """The run of the first option that gains most over the second, in words; empty without a pair."""
    pair = max(pairs, key=lambda pair: max(pair.ratios, default=0.0), default=None)
    if pair is None or pair.longest is None:
        return ""
    run = pair.longest
    place = f"{run.scene} in {run.form} at St = {short(run.stokes)}"
    return f"{run.solver}, {place}, tolerance {short(run.tolerance)}"


def figure(runs: Sequence[Run], note: str = "") -> Figure:
    """Time against St for the error shown, by the best form, back end and Jacobian of each solver.

    A solver has no point at a St where no run of it meets the error.
    """
    scenes = list(dict.fromkeys(run.scene for run in runs))
    drawing, grid = panels(len(scenes), 1, 0.5 + 2.6 * len(scenes), sharex=True)
    styles = looks(run.solver for run in runs)
    for axes, scene in zip(grid[:, 0], scenes, strict=True):
        own = [run for run in runs if run.scene == scene and run.meets(_SHOWN_ERROR)]
        for solver, look in styles.items():
            numbers = sorted({run.stokes for run in own if run.solver == solver})
            times = [
                1e3
                * min(run.seconds for run in own if (run.solver, run.stokes) == (solver, stokes))
                for stokes in numbers
            ]
            style = {"color": look.colour, "marker": look.marker, "linewidth": 1.2}
            axes.plot(numbers, times, markersize=5, label=solver, **style)
        axes.set(xscale="log", yscale="log")
        # Decades of both axes are as long.
        axes.set_aspect("equal")
        words = f"{scene}, to an error of {power(_SHOWN_ERROR)}"
        axes.set_title(words, fontsize=TITLE, loc="left", color=INK)
        axes.set_ylabel("time, ms")
    grid[-1, 0].set_xlabel("Stokes number St")
    handles, _ = grid[0, 0].get_legend_handles_labels()
    key(drawing, handles, 4)
    caption(drawing, note)
    return drawing
