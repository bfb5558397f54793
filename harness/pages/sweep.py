"""What a sweep leaves behind: a table and pictures for the reader, CSV files for the rest."""

import csv
from contextlib import ExitStack
from itertools import groupby
from pathlib import Path
from typing import Any

from polhode.harness.common.files import PartialFile, write_file
from polhode.harness.common.machine import header, here
from polhode.harness.common.store import Store
from polhode.harness.common.text import markdown
from polhode.harness.ensembles.summary import (
    arrival_rows,
    distribution_rows,
    ensemble_row,
    moment_rows,
    rate_rows,
    slow_rows,
    voigt_rows,
)
from polhode.harness.ensembles.sweep import NO_TIMES, Sweep, gather
from polhode.harness.pages.figures.ensembles import picture
from polhode.harness.pages.figures.work_precision import save

PAGE = "README.md"
FILES = {
    "moments.csv": (moment_rows, "orientation moments of second and fourth order, with standard errors"),
    "voigt.csv": (voigt_rows, "the same of fourth order as matrices in Voigt's order"),
    "rates.csv": (rate_rows, "mean squares of spinning and tumbling rates, with standard errors"),
    "slow.csv": (slow_rows, "means of L and E, with standard errors"),
    "distributions.csv": (distribution_rows, "histograms of L and E"),
    "arrivals.csv": (arrival_rows, "fraction arrived at each attractor against time, with 95 % intervals"),
}


def write_results(sweep: Sweep, store: Store, folder: Path) -> tuple[Path, list[dict[str, Any]]]:
    """Write the page and the CSV files of a finished sweep; returns the page's path, and a row for each ensemble.

    A file without rows, such as moments of averaged equations, which have no orientation, is left out.
    """
    ensembles, pictures, written = [], [], dict[str, csv.DictWriter]()
    with ExitStack() as files:
        # Of all that the store holds, one task and the statistics of one shape are in memory.
        for axes, same in groupby(sweep.ensembles, key=lambda ensemble: ensemble.ellipsoid.semi_axes):
            found = [(ensemble, gather(ensemble, store)) for ensemble in same]
            for ensemble, statistics in found:
                ensembles.append(ensemble_row(ensemble, statistics))
                for name, (make, _) in FILES.items():
                    for row in make(ensemble, statistics):
                        if name not in written:
                            file = files.enter_context(PartialFile(folder / name, summed=True))
                            written[name] = csv.DictWriter(file, list(row))
                            written[name].writeheader()
                        written[name].writerow(row)
            pictures.append((f"shape-{len(pictures) + 1}", " : ".join(f"{length:g}" for length in axes)))
            save(picture(found), folder, pictures[-1][0])
    write_file(folder / PAGE, _page(sweep, ensembles, [name for name in FILES if name in written], pictures))
    for name in FILES.keys() - written.keys():
        # Of a run by an earlier version.
        (folder / name).unlink(missing_ok=True)
    return folder / PAGE, ensembles


def _page(sweep: Sweep, ensembles: list[dict[str, Any]], names: list[str], pictures: list[tuple[str, str]]) -> str:
    columns = ("shape", "St", "equations", "particles", "failed", "arrived (95 %)", "median transient time (95 %)")
    lines = [
        (
            f"{row['a']:g} : {row['b']:g} : {row['c']:g}",
            f"{row['stokes']:g}",
            f"{row['equations']}, {row['method']}",
            row["particles"],
            sum(row["failures"].values()),
            "; ".join(f"{name}: {_interval(interval)}" for name, interval in row["arrived"].items()) or "–",
            _interval(row["transient_time"]["0.5"]) if row["transient_time"] else "–",
        )
        for row in ensembles
    ]
    table = markdown(columns, lines, right=(1, 3, 4))
    files = "\n".join(f"- [{name}]({name}): {FILES[name][1]}" for name in names)
    shown = "\n".join(f"## {shape}\n\n![Moments, L_z and arrivals]({name}.png)\n" for name, shape in pictures)
    top = header(sweep.title, "polhode sweep", [here()])
    return (
        "\n".join([*top, table]) + "\n"
        "Times are in units of the inverse shear rate, L and E over the largest moment of inertia. Failed particles "
        "are left out of every statistic.\n"
        "A particle has arrived when its L and E stay close to an attractor's up to the end of the run; `later` is "
        "after that end. No attractor is named (–) at St = 0 and ∞, where there is none, and at small St or for shapes "
        "close to a sphere, where the next fixed point is too near. Averaged equations have no orientation moments: "
        "their pictures show the means of L instead. Bands hold 95 %.\n\n"
        f"{shown}\n\n{files}\n\nEvery task's record says: {NO_TIMES}.\n"
    )


def _interval(interval: dict[str, float | None]) -> str:
    value, low, high = ("later" if end is None else f"{end:.4g}" for end in interval.values())
    return f"{value} ({low} to {high})"
