"""The page of hard cases: who got through, who is wrong, who failed and why.

A case is a scene, a St, a form and a tolerance; every solver that takes the form has one run of it.
A study whose `page` is "outcomes" has this page, as `harness/studies/hard_cases.toml`. Errors of runs
are errors of L and E, over I_max, against the exact solution of the run's own form.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from polhode.harness.analysis.frames import frame, rows_of
from polhode.harness.common.files import write_file
from polhode.harness.common.machine import provenance
from polhode.harness.common.store import Record, write_records
from polhode.harness.common.text import duration, markdown, scientific
from polhode.harness.pages.figures.style import rank
from polhode.harness.pages.tables import fill, lines_of
from polhode.harness.references.errors import magnitude
from polhode.harness.studies.study import Study
from polhode.models.files.scene_file import parse_scene
from polhode.models.scenes import SCENES
from polhode.solvers.contract import Status

# Solvers with at least this share of the most runs that a solver has are compared as to who never
# fails. A solver for spheroids alone has fewer runs, and so fewer to fail. An estimate: in
# reports/hard-cases a solver has either 0.95 of the most runs or more, or less than 0.1 of them.
_WIDELY_FROM = 0.9
# Columns of the rows of `endings` that tell cases apart.
_CASE = ["scene", "St", "form", "tolerance"]
# Columns that the shared records leave out, as they do empty ones: no page reads them from these
# records, which are thousands. `polhode export` writes all columns.
_LEFT_OUT = (
    "key",
    "errors",
    "seconds_runs",
    "statistics_uncertainty",
    "statistics_distance",
    "solver_slow_uncertainty",
)
# A run with a larger error of L and E against the exact solution of its own form counts as inaccurate.
# The unit is I_max, or the slow variables at the start if those are larger. An estimate: half or twice
# the limit moves about 1 % of the runs of reports/hard-cases to the other side.
INACCURATE = 1e-3
# How a run may end: at its end, accurately, inaccurately, or with an error that no reference tells;
# at a limit of time or steps; or with another failure.
_KINDS = ("reached", "inaccurate", "unknown", "stopped", "failed")
# Format of St, durations and tolerances in `outcomes.csv`: they are given, not measured, and 12 digits
# leave out what rounding adds to a product such as slow time times St.
_SETTING_FORMAT = "%.12g"


def sentences(endings: Sequence[Mapping[str, Any]], stopped: str) -> list[str]:
    """Who fails least, and how many runs ended how, from rows of `endings`; `stopped` is a `limit` in words."""
    runs = _runs(endings)
    counts = {"sums": Counter(runs["outcome"]), "all": len(runs), "inaccurate": INACCURATE}
    return lines_of("outcomes-sentences", **counts, **_surest(runs), stopped=stopped)


def _runs(endings: Sequence[Mapping[str, Any]]) -> Any:
    """Rows of `endings` as a frame, with whether each run got through in the column "passed"."""
    return pd.DataFrame(endings).assign(passed=lambda runs: runs["outcome"] == "reached")


def _surest(runs: Any) -> dict[str, Any]:
    """Fields of `texts/outcomes-sentences.md`: the solvers without a miss, and those that come nearest to that.

    Every run that did not reach its end accurately is a miss, also one that nobody got through. The solvers
    without a miss are "sure" if they take most cases, else "few"; each is a list of `_by_size`.
    """
    # A row for each solver: "size" is the number of its runs, "sum" of those that got through.
    taken = runs.groupby("solver", sort=False)["passed"].agg(["size", "sum"])
    widely = taken["size"] >= _WIDELY_FROM * taken["size"].max()
    without_a_miss = taken["size"] == taken["sum"]
    # The solvers of the fewest misses, of those that take most cases: several where they have as few.
    misses = (taken["size"] - taken["sum"])[widely]
    nearest = [*misses.index[misses == misses.min()]]
    nearest_runs = runs[runs["solver"].isin(nearest)]
    # How one solver missed; of several the sentence leaves this out.
    kinds = Counter(nearest_runs["outcome"]) if len(nearest) == 1 else {}
    # Whether one of them got through, by case.
    passed = nearest_runs.groupby(_CASE, sort=False)["passed"].any()
    missed_cases = passed.index[~passed]
    return {
        "sure": _by_size(taken[without_a_miss & widely]),
        "few": _by_size(taken[without_a_miss & ~widely]),
        "count": int(widely.sum()),
        "nearest": nearest,
        "through": int(taken["sum"][nearest[0]]),
        "runs": int(taken["size"][nearest[0]]),
        "kinds": [(kinds[kind], kind) for kind in _KINDS[1:] if kinds.get(kind)],
        # Cases that all of them missed, and of these the ones that another solver got through.
        "missed": len(missed_cases),
        "passed": int(missed_cases.isin(_passed_by_somebody(runs)).sum()),
    }


def _by_size(taken: Any) -> list[tuple[int, list[str]]]:
    """Solvers by the number of runs that they take; `taken` has a row for each, its runs under "size"."""
    return [(number, [*solvers.index]) for number, solvers in taken.groupby("size", sort=False)]


def _passed_by_somebody(runs: Any) -> Any:
    """The cases that at least one solver got through."""
    return runs[runs["passed"]].set_index(_CASE).index


def limit(table: pd.DataFrame) -> str:
    """The time limits of the runs in words, as "1.0 s or 4.0 s"; "time" where the records have none.

    It stands after "stopped at the limit of". A study that sets `max_steps` stops runs at these too.
    """
    limits = (
        sorted(set(table["max_seconds"].dropna().astype(float))) if "max_seconds" in table else []
    )
    return " or ".join(duration(seconds) for seconds in limits) or "time"


def write_page(study: Study, records: Sequence[Record], folder: Path, command: str) -> Path:
    """Write `README.md`, `outcomes.csv` and the records of a study into a folder; return the page's path.

    `command` is the command line that the page says it was made by. A checksum of the CSV file is kept.
    """
    table = frame(records)
    outcomes = endings(table, limits(records))
    write_file(
        folder / "outcomes.csv",
        pd.DataFrame(outcomes).to_csv(index=False, float_format=_SETTING_FORMAT),
        summed=True,
    )
    shared = (
        {name: record[name] for name in record.keys() - _LEFT_OUT if record[name] is not None}
        for record in records
    )
    write_records(shared, folder)
    runs = _runs(outcomes)
    stopped = limit(table)
    solvers = sorted(set(table["solver"]), key=rank)
    # By scene and solver: the number of runs that got through, and of all.
    passed = runs.groupby(["scene", "solver"])["passed"].agg(["sum", "size"])
    marks = [
        "✓" if got_through == total_runs else f"{got_through}/{total_runs}"
        for got_through, total_runs in passed.to_numpy().tolist()
    ]
    counts = pd.crosstab(runs["solver"], runs["outcome"]).reindex(
        index=solvers, columns=[*_KINDS], fill_value=0
    )
    total: Any = counts.sum(axis=1)
    percentages = (100 * counts["reached"] / total).sort_values(ascending=False, kind="stable")
    # A row for each solver, from the largest share of runs that got through to the least.
    surest = [
        [name, total[name], f"{percentage:.0f} %", *counts.loc[name]]
        for name, percentage in percentages.items()
    ]
    # A row for each scene, a column for each solver; a dot where there is no run.
    by_scene = (
        pd.Series(marks, passed.index).unstack().fillna("·").loc[runs["scene"].unique(), solvers]
    )
    page = fill(
        "outcomes",
        title=study.title,
        made=provenance(command, records),
        sentences=sentences(outcomes, stopped),
        counts=markdown(
            ["solver", "runs", "got through", *_KINDS], surest, right=range(1, 3 + len(_KINDS))
        ),
        inaccurate=INACCURATE,
        stopped=stopped,
        scenes=markdown(["scene", *solvers], [[*row] for row in by_scene.itertuples()]),
        hard=[f"{name}: {SCENES[name].summary}" for name in dict(study.scenes) if name in SCENES],
    )
    return write_file(folder / "README.md", page)


def limits(records: Sequence[Record]) -> dict[str, float]:
    """Error of L and E, over I_max, beyond which a run counts as inaccurate, by the scene's name.

    That is `INACCURATE` in its unit: `magnitude` is the largest slow variable at the start, over I_max.
    """
    # The first record of a scene's name gives the scene.
    named = {record["scene_name"]: record["scene"] for record in reversed(records)}
    scenes = {name: parse_scene(content) for name, content in named.items()}
    return {
        name: INACCURATE * max(1.0, magnitude(scene.ellipsoid, scene.initial))
        for name, scene in scenes.items()
    }


def outcome(run: dict[Any, Any], allowed: float = INACCURATE) -> tuple[str, str]:
    """How a run ended: one of `_KINDS`, and the reason in words.

    `run` is one of `frames.rows_of`, whose values are None where the record has none; `allowed` is
    one of `limits`.
    """
    status = str(run["status"])
    if status != Status.REACHED_END:
        # Records of another version may have a status that this one does not know.
        meaning = Status(status).meaning if status in set(Status) else ""
        kind = "stopped" if status in (Status.TIME_LIMIT, Status.STEP_LIMIT) else "failed"
        return kind, f"{status.replace('_', ' ')}: {run.get('message') or meaning}"
    error = run.get("solver_slow_error")
    seconds = run.get("seconds")
    took = f"{duration(seconds)}, " if seconds is not None else ""
    if error is None:
        failure = run.get("reference_failed")
        return "unknown", f"reached the end, but {failure or 'there is no certified reference'}"
    # Error of L and E, over I_max, of the form's exact solution against the full equations.
    model = run.get("model_slow_error") or 0.0
    off = f"; the form itself is off by {scientific(model)}" if model > 0 else ""
    kind = "reached" if error <= allowed else "inaccurate"
    return kind, f"{took}solver error {scientific(error)}{off}"


def endings(table: pd.DataFrame, allowed: Mapping[str, float]) -> list[dict[str, Any]]:
    """How every run ended: scene, St, duration, tolerance, form, solver, outcome and reason.

    `table` is a `frames.frame` of records, `allowed` are the `limits` by scene. The duration, "time",
    is in inverse shear rates.
    """
    outcomes = []
    for run in rows_of(table):
        scene = str(run["scene_name"])
        kind, reason = outcome(run, allowed[scene])
        outcomes.append(
            {
                "scene": scene,
                "St": float(run["stokes"]),
                "time": run.get("scene.time"),
                "tolerance": float(run["tolerance"]),
                "form": str(run["form"]),
                "solver": str(run["solver"]),
                "outcome": kind,
                "reason": reason,
            }
        )
    return outcomes
