"""The page of `polhode throughput`: what ensembles cost, and what large sweeps would."""

import json
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt

from polhode.harness.common.files import write_file
from polhode.harness.common.machine import header
from polhode.harness.common.text import markdown
from polhode.harness.pages.figures.work_precision import save
from polhode.harness.pages.tables import bullets, fill, lines_of, table

PAGE = "throughput.md"
# Sweeps whose cost is laid out: shape, equations, particles, St.
PLANS = (
    ("1 : 1 : 2", "full", 1_000_000, 1e3),
    ("1 : 1 : 2", "full", 1_000_000_000, 1e3),
    ("1 : 0.8 : 0.5", "full", 1_000_000_000, 1e3),
    ("1 : 0.8 : 0.5", "full", 10_000_000, 1e5),
    ("1 : 0.8 : 0.5", "averaged", 1_000_000_000, 1e3),
)
BLOCK = 100_000

Found = dict[str, Any]


def write_page(found: Found, folder: Path) -> Path:
    """Write ``throughput.json``, a picture of it and ``throughput.md`` into a folder; returns the page's path."""
    write_file(folder / "throughput.json", json.dumps(found, indent=1) + "\n")
    save(picture(found["full"]), folder, "throughput")
    write_file(folder / PAGE, page(found))
    return folder / PAGE


def picture(rows: list[Found]) -> Any:
    """Particles per second against the largest error, a colour for each shape."""
    figure, axes = plt.subplots(figsize=(6.5, 4), layout="constrained")
    for shape, shade in zip(dict.fromkeys(row["shape"] for row in rows), ("#0072B2", "#D55E00"), strict=False):
        some = [row for row in rows if row["shape"] == shape]
        for speed, error, line, name in (
            ("per_second", "error", "o-", "equal steps"),
            ("taylor_per_second", "taylor_error", "s:", "Taylor"),
        ):
            errors, speeds = ([row[each] for row in some] for each in (error, speed))
            axes.loglog(errors, speeds, line, color=shade, label=f"{name}, {shape}")
    axes.set(xlabel="largest error of the whole state", ylabel="particles per second and core")
    axes.grid(True, which="both", linewidth=0.4, alpha=0.5)
    axes.legend(frameon=False)
    return figure


def page(found: Found) -> str:
    """The measured figures as a page."""
    return fill(
        "throughput",
        header=header("What ensembles cost", "polhode throughput", [found]),
        findings=bullets(_findings(found)),
        full=table(found["full"], "throughput-full"),
        long=table(found["long"], "throughput-long"),
        tasks=table(found["tasks"], "throughput-tasks"),
        block=BLOCK,
        plan=_plan(found),
        overhead=table(found["overhead"], "throughput-engines"),
        mib=(found["memory"]["bytes"] or 0) / 2**20,
        cores=found["machine"]["cores"],
        **{name: found[name] for name in ("settings", "memory", "two_processes")},
    )


def _findings(found: Found) -> list[str]:
    """Particles per second, in sentences."""
    full = [lines_of("throughput-full", **row) for row in found["full"]]
    both = {name: found["settings"][name] for name in ("long_stokes", "long_error")}
    long = [lines_of("throughput-long", **row, **both, which=row["equations"].capitalize()) for row in found["long"]]
    return [line for lines in (*full, *long) for line in lines]


def _plan(found: Found) -> str:
    """Tasks, bytes in the store and core hours of large sweeps, in blocks of `BLOCK`, from measured whole tasks."""
    rows = []
    for shape, equations, particles, stokes in PLANS:
        row = next(row for row in found["tasks"] if (row["shape"], row["equations"]) == (shape, equations))
        # The number of rotations, and with it the cost of full equations, grows in proportion to St.
        rate = row["per_second"] * (found["settings"]["stokes"] / stokes if equations == "full" else 1.0)
        count = -(-particles // BLOCK)
        mib, hours = count * row["record_bytes"] / 2**20, particles / rate / 3600
        numbers = f"{particles:,}", f"{stokes:g}", f"{count:,}", f"{mib:,.1f} MiB", f"{hours:,.2f}"
        rows.append((shape, equations, *numbers))
    return markdown(("shape", "equations", "particles", "St", "tasks", "store", "core hours"), rows, right=range(2, 7))
