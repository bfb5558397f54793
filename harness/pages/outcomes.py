"""The page of hard cases: who got through, who is wrong, who failed and why."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

from polhode.harness.analysis.frames import frame
from polhode.harness.analysis.outcomes import INACCURATE, KINDS, Block, Ending, blocks, columns, limits, outcome
from polhode.harness.common.files import write_file
from polhode.harness.common.machine import header
from polhode.harness.common.store import Record, export
from polhode.harness.common.text import duration, markdown, short
from polhode.harness.studies.study import Study
from polhode.models.scenes import SCENES

BEYOND = f"off by more than {short(INACCURATE)} of the largest slow variable at the start, or of I_max if larger"
SIGNS = {"reached": "✓", "inaccurate": "≈", "unknown": "?", "stopped": "◷", "failed": "✕", "absent": "·"}
# What the shared records leave out, for there are thousands: `polhode export` writes all.
LEFT_OUT = ("key", "errors", "seconds_runs", "statistics_uncertainty", "statistics_distance", "solver_slow_uncertainty")


def title(block: Block) -> str:
    """Scene, St, duration and tolerance in words."""
    scene, stokes, time, tolerance = block
    duration_in_words = "" if time is None else f", t = {short(time)}"
    return f"{scene}, St = {short(stokes)}{duration_in_words}, tolerance {short(tolerance)}"


def about(block: Block) -> str:
    """What is hard about a built-in scene; empty for others."""
    return SCENES[block[0]].summary if block[0] in SCENES else ""


def reasons(forms: dict[str, dict[str, Ending]]) -> list[str]:
    """What was not reached, and why, one line for the solvers of one form and reason."""
    found: dict[tuple[str, str, str], list[str]] = {}
    for form, cells in forms.items():
        for solver, (kind, reason) in cells.items():
            if kind != "reached":
                found.setdefault((form, kind, reason), []).append(solver)
    return [f"{form}, {', '.join(names)}: {kind}, {reason}" for (form, kind, reason), names in found.items()]


def sentences(table: pd.DataFrame, allowed: Mapping[str, float]) -> list[str]:
    """How many got through, and who."""
    kinds = [outcome(run, allowed[str(run["scene_name"])])[0] for run in table.to_dict("records")]
    sums = {kind: kinds.count(kind) for kind in KINDS}
    reached = pd.Series([kind == "reached" for kind in kinds]).groupby(list(table["solver"].astype(str)))
    stuck, total = (reached.count() - reached.sum()).to_dict(), reached.count().to_dict()
    best = sorted(total, key=lambda name: (stuck[name] / total[name], name))
    through, worst = [name for name in best if stuck[name] == 0], best[-1]
    return [
        f"{sums['reached']} of {len(kinds)} runs reached the end with a solver error below {short(INACCURATE)} of "
        "the start; "
        f"{sums['inaccurate']} reached it with a larger one, {sums['unknown']} with one that no reference knows; "
        f"{sums['stopped']} were stopped at the limit of {limit(table)}; {sums['failed']} failed.",
        f"Through every case they take: {', '.join(through) or 'nobody'}.",
        f"Most often stuck: {worst}, {stuck[worst]} of {total[worst]}.",
    ]


def limit(table: pd.DataFrame) -> str:
    """The time limit of the runs in words."""
    limits = sorted(set(table["max_seconds"].dropna().astype(float))) if "max_seconds" in table else []
    return " or ".join(duration(each) for each in limits) or "time"


def write_page(study: Study, records: Sequence[Record], folder: Path, command: str) -> Path:
    """Write the page of a study of several scenes, and its records, into a folder and return the page's path."""
    table = frame(records)
    folder.mkdir(parents=True, exist_ok=True)
    export([_shared(record) for record in records], folder / "records.jsonl")
    page = folder / "README.md"
    write_file(page, "\n".join(_lines(study, table, records, command)))
    return page


def _shared(record: Record) -> Record:
    """What of a record is shared: nothing that is empty, and not `LEFT_OUT`."""
    return {name: value for name, value in record.items() if value is not None and name not in LEFT_OUT}


def _lines(study: Study, table: pd.DataFrame, records: Sequence[Record], command: str) -> list[str]:
    solvers, allowed = columns(table), limits(records)
    lines = [
        *header(study.title, command, records),
        *(f"- {sentence}" for sentence in sentences(table, allowed)),
        "",
        f"✓ reached; ≈ reached, but {BEYOND}; ? reached, with an error no reference knows; "
        f"◷ stopped at the limit of {limit(table)}; ✕ failed; · not run: the form or the solver does not take it. "
        "Errors are slow errors over I_max against the exact solution of the same form. Every run: "
        "[records.jsonl](records.jsonl); `polhode export` of the store writes them in full.",
        "",
    ]
    for block, forms in blocks(table, allowed).items():
        rows = [
            [form, *(SIGNS[cells.get(name, ("absent", ""))[0]] for name in solvers)] for form, cells in forms.items()
        ]
        lines += [f"## {title(block)}", "", *([about(block), ""] if about(block) else [])]
        lines += [markdown(["form", *solvers], rows), *(f"- {reason}" for reason in reasons(forms)), ""]
    return lines
