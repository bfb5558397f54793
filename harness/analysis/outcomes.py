"""What became of runs on hard cases: reached, inaccurate, of unknown error, stopped or failed, with the reason."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polhode.harness.analysis.frames import frame
from polhode.harness.common.machine import header
from polhode.harness.common.store import Record, export
from polhode.harness.common.text import duration, markdown, scientific
from polhode.harness.studies.study import Study
from polhode.models.scene_file import parse_scene
from polhode.models.scenes import SCENES
from polhode.solvers.catalogue import SOLVERS
from polhode.solvers.contract import Status

# A run that reached its end but is further off the exact solution of its own form, in units of I_max or of the slow
# variables at the start if those are larger, has no digits to trust.
INACCURATE = 1e-3
BEYOND = f"off by more than {INACCURATE:g} of the largest slow variable at the start, or of I_max if that is larger"
KINDS = ("reached", "inaccurate", "unknown", "stopped", "failed")
SIGNS = {"reached": "✓", "inaccurate": "≈", "unknown": "?", "stopped": "◷", "failed": "✕", "absent": "·"}
# What the shared records leave out, for there are thousands: `polhode export` writes all.
LEFT_OUT = ("key", "errors", "seconds_runs", "statistics_uncertainty", "statistics_distance", "solver_slow_uncertainty")

Block = tuple[str, float, float | None, float]
"""Scene, St, duration in inverse shear rates where it is known, and tolerance."""
Outcome = tuple[str, str]
"""One of `KINDS`, and the reason in words."""


def limits(records: Iterable[Record]) -> dict[str, float]:
    """Slow error over I_max beyond which a run counts as inaccurate, by scene."""
    found: dict[str, float] = {}
    for record in records:
        if record["scene_name"] not in found:
            scene = parse_scene(record["scene"])
            largest = float(np.max(np.abs(scene.initial.slow))) / max(scene.ellipsoid.inertia)
            found[record["scene_name"]] = INACCURATE * max(1.0, largest)
    return found


def outcome(run: dict[Any, Any], allowed: float = INACCURATE) -> Outcome:
    """Outcome of a run, from its record as a row of `frames.frame`; `allowed` is one of `limits`."""
    status = str(run["status"])
    if status != Status.REACHED_END:
        meaning = Status(status).meaning if status in set(Status) else ""
        kind = "stopped" if status in (Status.TIME_LIMIT, Status.STEP_LIMIT) else "failed"
        return kind, f"{status.replace('_', ' ')}: {_known(run.get('message')) or meaning}"
    error, seconds = _known(run.get("solver_slow_error")), _known(run.get("seconds"))
    took = f"{duration(seconds)}, " if seconds is not None else ""
    if error is None:
        failure = _known(run.get("reference_failed"))
        return "unknown", f"reached the end, but {failure or 'there is no certified reference'}"
    model = _known(run.get("model_slow_error")) or 0.0
    off = f"; the form itself is off by {scientific(model)}" if model > 0 else ""
    return ("reached" if error <= allowed else "inaccurate"), f"{took}solver error {scientific(error)}{off}"


def blocks(table: pd.DataFrame, allowed: Mapping[str, float]) -> dict[Block, dict[str, dict[str, Outcome]]]:
    """Outcomes by scene, form and solver."""
    found: dict[Block, dict[str, dict[str, Outcome]]] = {}
    for run in table.to_dict("records"):
        time = _known(run.get("scene.time"))
        block = str(run["scene_name"]), float(run["stokes"]), time, float(run["tolerance"])
        found.setdefault(block, {}).setdefault(str(run["form"]), {})[str(run["solver"])] = outcome(
            run, allowed[block[0]]
        )
    return found


def title(block: Block) -> str:
    """Scene, St, duration and tolerance in words."""
    scene, stokes, time, tolerance = block
    duration_in_words = "" if time is None else f", t = {time:g}"
    return f"{scene}, St = {stokes:g}{duration_in_words}, tolerance {tolerance:g}"


def about(block: Block) -> str:
    """What is hard about a built-in scene; empty for others."""
    return SCENES[block[0]].summary if block[0] in SCENES else ""


def columns(table: pd.DataFrame) -> list[str]:
    """Solvers in the order of the catalogue, others last."""
    found = set(table["solver"])
    return [name for name in SOLVERS if name in found] + sorted(found - set(SOLVERS))


def reasons(forms: dict[str, dict[str, Outcome]]) -> list[str]:
    """What was not reached, and why, one line for the solvers of one form and reason."""
    found: dict[tuple[str, str, str], list[str]] = {}
    for form, cells in forms.items():
        for solver, (kind, reason) in cells.items():
            if kind != "reached":
                found.setdefault((form, kind, reason), []).append(solver)
    return [f"{form}, {', '.join(names)}: {kind}, {reason}" for (form, kind, reason), names in found.items()]


def sentences(table: pd.DataFrame, allowed: Mapping[str, float]) -> list[str]:
    """How many got through, and who."""
    counts: dict[str, dict[str, int]] = {}
    for run in table.to_dict("records"):
        counts.setdefault(str(run["solver"]), dict.fromkeys(KINDS, 0))[
            outcome(run, allowed[str(run["scene_name"])])[0]
        ] += 1
    total = {name: sum(own.values()) for name, own in counts.items()}
    sums = {kind: sum(own[kind] for own in counts.values()) for kind in KINDS}
    best = sorted(counts, key=lambda name: (-counts[name]["reached"] / total[name], name))
    through = [name for name in best if counts[name]["reached"] == total[name]]
    worst = best[-1]
    return [
        f"{sums['reached']} of {sum(total.values())} runs reached the end with a solver error below {INACCURATE:g} of "
        "the start; "
        f"{sums['inaccurate']} reached it with a larger one, {sums['unknown']} with one that no reference tells; "
        f"{sums['stopped']} were stopped at the limit of {limit(table)}; {sums['failed']} failed.",
        f"Through every case they take: {', '.join(through) or 'nobody'}.",
        f"Most often stuck: {worst}, {total[worst] - counts[worst]['reached']} of {total[worst]}.",
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
    page.write_text("\n".join(_lines(study, table, records, command)), encoding="utf-8")
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
        f"✓ reached; ≈ reached, but {BEYOND}; ? reached, with an error no reference tells; "
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


def _known(value: Any) -> Any:
    return None if value is None or value is pd.NA or value != value else value
