"""What a sweep leaves behind: a table and pictures for the reader, CSV files for the rest."""

from pathlib import Path
from typing import Any

from polhode.harness.common.files import write_file
from polhode.harness.common.machine import header, machine, now, versions
from polhode.harness.common.store import Store, export
from polhode.harness.common.text import markdown
from polhode.harness.ensembles.ensemble import Ensemble
from polhode.harness.ensembles.statistics import Statistics
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
    ensembles, pictures = [], []
    found: dict[tuple[float, ...], list[tuple[Ensemble, Statistics]]] = {}
    rows: dict[str, list[dict[str, Any]]] = {name: [] for name in FILES}
    for ensemble in sweep.ensembles:
        statistics = gather(ensemble, store)
        found.setdefault(ensemble.ellipsoid.semi_axes, []).append((ensemble, statistics))
        ensembles.append(ensemble_row(ensemble, statistics))
        for name, (make, _) in FILES.items():
            rows[name] += make(ensemble, statistics)
    rows = {name: records for name, records in rows.items() if records}
    for name, records in rows.items():
        export(records, folder / name)
    for number, each in enumerate(found.values(), start=1):
        save(picture(each), folder, f"shape-{number}")
        pictures.append((f"shape-{number}", " : ".join(f"{length:g}" for length in each[0][0].ellipsoid.semi_axes)))
    write_file(folder / PAGE, _page(sweep, ensembles, tuple(rows), pictures))
    for name in FILES.keys() - rows.keys():
        # Of a run by an earlier version.
        (folder / name).unlink(missing_ok=True)
    return folder / PAGE, ensembles


def _page(
    sweep: Sweep, ensembles: list[dict[str, Any]], names: tuple[str, ...], pictures: list[tuple[str, str]]
) -> str:
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
    top = header(sweep.title, "polhode sweep", [{"machine": machine(), "versions": versions(), "date": now()}])
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
