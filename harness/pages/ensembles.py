"""The page of `polhode throughput`: what ensembles cost, and what large sweeps would."""

import json
from pathlib import Path
from typing import Any

from polhode.harness.common.files import write_file
from polhode.harness.common.text import markdown, scientific

# Sweeps whose cost is laid out: equations, particles, St; the first two are 10⁹ particle·St.
PLANS = (
    ("full", 1_000_000, 1e3),
    ("full", 10_000, 1e5),
    ("full", 1_000_000_000, 1e3),
    ("averaged", 1_000_000_000, 1e3),
)
BLOCK = 100_000

Found = dict[str, Any]


def write_page(found: Found, folder: Path) -> Path:
    """Write ``throughput.json`` and ``README.md`` into a folder; returns the page's path."""
    write_file(folder / "throughput.json", json.dumps(found, indent=1) + "\n")
    write_file(folder / "README.md", page(found))
    return folder / "README.md"


def page(found: Found) -> str:
    """The measured figures as a page."""
    settings = found["settings"]
    return "\n".join(
        [
            "# What ensembles cost\n",
            f"St = {settings['stokes']:g}, t₂ = {settings['slow_time']:g}, isotropic starts of |L| = 0.7 I_max, on "
            f"{found['machine']['processor']}. Made by `polhode throughput`; "
            "the numbers are in [throughput.json](throughput.json). Processor time, the least of "
            f"{settings['rounds']} runs in turns, one process at a time.\n",
            f"## Full equations, Taylor at tolerance {settings['tolerance']:g}, particles per second and core\n",
            _table(found["full"], FULL),
            f"## Averaged equations at tolerance {settings['averaged_tolerance']:g}, particles per second and core\n",
            _table(found["averaged"], AVERAGED),
            "Where their time goes, in microseconds a particle:\n",
            _shares(found),
            "## Whole tasks, statistics at 101 samples and 11 snapshots included\n",
            _table(found["tasks"], TASKS),
            f"## What large sweeps to t₂ = {settings['slow_time']:g} take, in tasks of up to {BLOCK:,} particles\n",
            _plan(found),
            f"## What an engine adds to tasks of {settings['task_seconds']:g} s\n",
            _table(found["overhead"], ENGINES),
            "## Memory and processes\n",
            _memory(found),
        ]
    )


def _table(rows: list[Found], columns: dict[str, str]) -> str:
    """A table of rows whose errors read as 1.2e-7: header to the format of a row's cell."""
    rows = [{name: scientific(row[name]) if "error" in name else row[name] for name in row} for row in rows]
    cells = [[text.format(**row) for text in columns.values()] for row in rows]
    return markdown(list(columns), cells, right=range(1, len(columns)))


FULL = {
    "shape": "{shape}",
    "one by one": "{scalar_per_second:,.0f}",
    "in lanes": "{lanes_per_second:,.0f}",
    "ratio": "{speedup:.2f}",
    "error": "{scalar_error}",
    "error in lanes": "{lanes_error}",
}
AVERAGED = {
    "shape": "{shape}",
    "end alone": "{per_second:,.0f}",
    "101 samples": "{sampled_per_second:,.0f}",
    "whole tasks": "{task_per_second:,.0f}",
    "median error": "{median_error}",
    "error of 99 %": "{error_of_99_percent}",
}
TASKS = {
    "equations": "{equations}",
    "particles per second and core": "{per_second:,.0f}",
    "bytes of a record": "{record_bytes:,}",
}
ENGINES = {"engine": "{engine}", "overhead": "{share:.2%}"}


def _shares(found: Found) -> str:
    """Microseconds a particle: the field, the rest of the steps, the samples, the statistics."""
    rows = []
    for row in found["averaged"]:
        end, sampled, task = (1e6 / row[name] for name in ("per_second", "sampled_per_second", "task_per_second"))
        field = row["field_share"] * end
        parts = (field, end - field, sampled - end, task - sampled)
        rows.append((row["shape"], f"{row['evaluations_per_particle']:.0f}", *(f"{part:.1f}" for part in parts)))
    header = ("shape", "evaluations", "these", "the steps' arithmetic", "101 samples", "drawing and statistics")
    return markdown(header, rows, right=(1, 2, 3, 4, 5))


def _plan(found: Found) -> str:
    """Tasks, bytes in the store and core hours of large sweeps, in blocks of `BLOCK`, from measured whole tasks."""
    rows = []
    for equations, particles, stokes in PLANS:
        row = next(row for row in found["tasks"] if row["equations"] == equations)
        # The number of rotations, and with it the cost of full equations, grows in proportion to St.
        rate = row["per_second"] * (found["settings"]["stokes"] / stokes if equations == "full" else 1.0)
        count = -(-particles // BLOCK)
        rows.append(
            (
                equations,
                f"{particles:,}",
                f"{stokes:g}",
                f"{count:,}",
                f"{count * row['record_bytes'] / 2**20:,.1f} MiB",
                f"{particles / rate / 3600:,.2f}",
            )
        )
    return markdown(("equations", "particles", "St", "tasks", "store", "core hours"), rows, right=(1, 2, 3, 4, 5))


def _memory(found: Found) -> str:
    two, used = found["two_processes"], found["memory"]
    return (
        f"- {used['particles']:,} particles of the full equations: at most "
        f"{(used['bytes'] or 0) / 2**20:.0f} MiB in the process that runs them, {used['seconds']:.1f} s.\n"
        f"- Two processes against one on {found['machine']['cores']} cores, {two['particles']:,} particles: "
        f"{two['ratio']:.2f} times as fast ({two['one_seconds']:.1f} s and {two['two_seconds']:.1f} s).\n"
    )
