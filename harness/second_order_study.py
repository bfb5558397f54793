"""Orders and cost of `averaged-second-order`: ``python -m polhode.harness.second_order_study [--quick | --resonant]``.

Writes `README.md` and its data (orders, slopes, resonances, crossings, cost) under `reports/second-order`.
"""

import csv
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from functools import partial
from math import nan
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np

from polhode.harness import second_order_resonances as resonant
from polhode.harness.errors import errors
from polhode.harness.second_order_cases import (
    AGAINST,
    GENTLE,
    PAPER,
    SAMPLES,
    TILTED,
    TOLERANCE,
    Case,
    timed_run,
    true_observables,
)
from polhode.harness.second_order_resonances import ResonantRow
from polhode.harness.text import duration, markdown, scientific
from polhode.models.scene import BodyStart, Scene, Start
from polhode.models.second_order import SecondOrder
from polhode.models.shape import Ellipsoid

# Rows of the resonant runs, and of those that meet L² = 2EI₂.
Passages = tuple[Sequence[ResonantRow], Sequence[ResonantRow]]

REPORT = Path("reports/second-order")
FULL_TOLERANCES = (1e-8, 1e-9, 1e-10, 1e-11, 1e-12)
# Slopes are fitted where the error is below this and above so many times the reference's uncertainty.
LARGEST_ERROR, FLOORS = 1e-2, 100.0


def _spheroid(kappa: float, start: Start, slow_time: float, exponents: tuple[float, ...] = (4, 4.5, 5, 5.5, 6)) -> Case:
    return Case((1.0, 1.0, kappa), start, slow_time, exponents)


CASES = (
    *(_spheroid(kappa, start, 0.1) for kappa in (0.1, 0.25, 0.5, 2.0) for start in (PAPER, AGAINST)),
    *(_spheroid(kappa, GENTLE, 0.1) for kappa in (0.5, 2.0)),
    *(_spheroid(4.0, start, 0.05) for start in (PAPER, AGAINST)),
    *(_spheroid(10.0, start, 0.02, (4.5, 5, 5.5, 6, 6.5)) for start in (PAPER, AGAINST)),
    *(
        Case(axes, BodyStart(TILTED, spin), 0.03)
        for axes, spin in (
            ((1.0, 0.8, 0.5), (0.3, 0.2, 1.5)),
            ((1.0, 0.8, 0.5), (0.6, 0.5, 1.0)),
            ((1.0, 0.8, 0.5), (1.5, 0.2, 0.1)),
            ((0.5, 1.0, 0.8), (-1.2, 0.5, 0.4)),
            ((1.0, 0.6, 0.4), (0.1, 0.1, -0.8)),
            ((1.0, 0.6, 0.4), (0.3, 0.2, 1.5)),
            ((1.0, 0.9, 0.3), (0.5, -0.4, -1.2)),
            ((1.0, 0.9, 0.3), (0.6, 0.5, 1.0)),
        )
    ),
)


@dataclass(frozen=True)
class Row:
    """Errors of one run over `SAMPLES` equispaced samples; slow ones over I_max, orientation in rad."""

    shape: str
    start: str
    slow_time: float
    stokes: float
    slow: float
    orientation: float
    first_order_slow: float
    estimated_slow: float
    estimated_orientation: float
    slow_uncertainty: float
    orientation_uncertainty: float


@dataclass(frozen=True)
class Slope:
    """Fitted exponents of St, with the numbers of points they rest on; orientation over the top two decades."""

    shape: str
    start: str
    slow: float
    slow_points: int
    orientation: float
    orientation_points: int


def measure(case: Case, stokes: float) -> Row:
    """Errors of first and second order, and the form's own estimate, against the full form in long double."""
    scene = case.scene(stokes)
    form = SecondOrder()
    true, uncertainty = true_observables(scene)
    found, _ = timed_run(scene, form.name, TOLERANCE, SAMPLES)
    triaxial = scene.ellipsoid.kind == "triaxial"
    first, _ = timed_run(scene, "averaged" if triaxial else "averaged-spheroid", TOLERANCE, SAMPLES)
    error, estimate = errors(scene.ellipsoid, found, true), form.estimate(scene)
    return Row(
        *case.names,
        case.slow_time,
        stokes,
        error.slow,
        nan if error.orientation is None else error.orientation,
        errors(scene.ellipsoid, first, true).slow,
        estimate.slow,
        estimate.orientation,
        uncertainty.slow,
        nan if uncertainty.orientation is None else uncertainty.orientation,
    )


def slopes(rows: Sequence[Row]) -> list[Slope]:
    """Fitted exponents, one per case."""
    cases = dict.fromkeys((row.shape, row.start) for row in rows)
    return [_slope([row for row in rows if (row.shape, row.start) == case]) for case in cases]


def _slope(rows: list[Row]) -> Slope:
    top = max(row.stokes for row in rows)
    slow = [(r.stokes, r.slow) for r in rows if FLOORS * r.slow_uncertainty < r.slow < LARGEST_ERROR]
    turned = [(r.stokes, r.orientation) for r in rows if r.stokes >= 0.99e-2 * top]
    return Slope(rows[0].shape, rows[0].start, _exponent(slow), len(slow), _exponent(turned), len(turned))


def _exponent(points: Sequence[tuple[float, float]]) -> float:
    if len(points) < 2:
        return nan
    x, y = np.log10(np.array(points)).T
    return float(np.polyfit(x, y, 1)[0])


@dataclass(frozen=True)
class Cost:
    """Wall time of one run, output of the observables included; the slow error where it was measured."""

    form: str
    solver: str
    tolerance: float
    stokes: float
    samples: int
    seconds: float
    slow: float


def costs(repeats: int = 7) -> Iterator[Cost]:
    """Cost against St of the second-order form, then first order and the full form at St = 1e6, t₂ = 0.5."""
    few = 11
    for exponent in range(3, 9):
        scene = Scene(Ellipsoid((1.0, 1.0, 2.0)), 10.0**exponent, PAPER, 0.5 * 10.0**exponent)
        seconds = _best(partial(_seconds, scene, SecondOrder.name, 1e-9, few), repeats)
        yield Cost(SecondOrder.name, "taylor", 1e-9, scene.stokes, few, seconds, nan)
    scene = Scene(Ellipsoid((1.0, 1.0, 2.0)), 1e6, PAPER, 0.5e6)
    true, _ = timed_run(scene, "spheroid-axis", 1e-16, few)
    trials = [
        (SecondOrder.name, "taylor", (1e-9,)),
        ("averaged-spheroid", "taylor", (1e-9,)),
        *(("spheroid-axis", solver, FULL_TOLERANCES) for solver in ("taylor", "cyrk-vern8", "cyrk-dop853")),
    ]
    for name, solver, tolerances in trials:
        for tolerance in tolerances:
            found, seconds = timed_run(scene, name, tolerance, few, solver)
            slow = errors(scene.ellipsoid, found, true).slow
            if slow <= 1e-6 or len(tolerances) == 1:
                best = _best(partial(_seconds, scene, name, tolerance, few, solver), 2)
                yield Cost(name, solver, tolerance, 1e6, few, min(seconds, best), slow)
                break


def _best(run: Callable[[], float], repeats: int) -> float:
    return min(run() for _ in range(repeats))


def _seconds(scene: Scene, name: str, tolerance: float, samples: int, solver: str = "taylor") -> float:
    return timed_run(scene, name, tolerance, samples, solver)[1]


def page(rows: Sequence[Row], fitted: Sequence[Slope], passages: Passages, cost: Sequence[Cost]) -> str:
    """The report as Markdown."""
    orders = markdown(
        ("axes", "start", "slope, slow", "points", "slope, orientation", "points"),
        [
            (s.shape, s.start, f"{s.slow:.2f}", s.slow_points, f"{s.orientation:.2f}", s.orientation_points)
            for s in fitted
        ],
        right=range(2, 6),
    )  # fmt: skip
    table = markdown(
        ("axes", "start", "t₂", "St", "slow", "estimated", "first order", "orientation", "estimated"),
        [
            (
                row.shape,
                row.start,
                row.slow_time,
                f"{row.stokes:.2g}",
                *map(scientific, (row.slow, row.estimated_slow, row.first_order_slow)),
                *map(scientific, (row.orientation, row.estimated_orientation)),
            )
            for row in rows
        ],
        right=range(2, 9),
    )
    times = markdown(
        ("form", "solver", "tolerance", "St", "time", "slow error"),
        [(c.form, c.solver, c.tolerance, f"{c.stokes:g}", duration(c.seconds), scientific(c.slow)) for c in cost],
        right=range(2, 6),
    )
    return "\n".join(
        (
            "# Second-order averaging: orders and cost\n",
            "Written by `python -m polhode.harness.second_order_study`; the data stand beside it.\n",
            f"Errors are maxima over {SAMPLES} samples, slow ones over I_max, orientation in rad, against the full "
            f"form in long double. Slopes: slow where the error lies below {LARGEST_ERROR:g} and above "
            f"{FLOORS:g} times "
            "the reference's uncertainty, orientation over the top two decades.\n",
            "## Orders\n",
            orders,
            "## Errors and the form's own estimates\n",
            table,
            resonant.section(*passages),
            "## Cost\n",
            "Axes 1:1:2, t₂ = 0.5, eleven output times; integration and observables, best of several.\n",
            times,
        )
    )


def write(directory: Path, rows: Sequence[Row], passages: Passages, cost: Sequence[Cost]) -> None:
    """Write data and page."""
    directory.mkdir(parents=True, exist_ok=True)
    fitted = slopes(rows)
    _write_csv(directory / "orders.csv", Row, rows)
    _write_csv(directory / "slopes.csv", Slope, fitted)
    _write_csv(directory / "resonances.csv", ResonantRow, passages[0])
    _write_csv(directory / "crossings.csv", ResonantRow, passages[1])
    _write_csv(directory / "cost.csv", Cost, cost)
    (directory / "README.md").write_text(page(rows, fitted, passages, cost), encoding="utf-8")


def _write_csv(path: Path, kind: type, rows: Sequence[Any]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [entry.name for entry in fields(kind)], lineterminator="\n")
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)


def _read_csv(path: Path, kind: type) -> list[Any]:
    readers: dict[str, Callable[[str], Any]] = get_type_hints(kind)
    with path.open(newline="", encoding="utf-8") as file:
        return [kind(**{name: read(row[name]) for name, read in readers.items()}) for row in csv.DictReader(file)]


def _measured(cases: Sequence[Case], points: int | None, take: Callable[[Case, float], Any]) -> list[Any]:
    rows = []
    for case in cases:
        for exponent in case.exponents[:points]:
            rows.append(take(case, float(f"{10**exponent:.3g}")))
            print(rows[-1], file=sys.stderr, flush=True)
    return rows


def _passages(cases: int | None = None, points: int | None = None) -> Passages:
    return (
        _measured(resonant.CASES[:cases], points, resonant.measure),
        _measured(resonant.CROSSING[:cases], points, resonant.measure_crossing),
    )


def main(arguments: Sequence[str]) -> None:
    """Run the study; with `--quick`, one case of each kind and no cost; with `--resonant`, the last two kinds alone."""
    if "--quick" in arguments:
        write(REPORT, _measured(CASES[:1], 3, measure), _passages(1, 2), [])
    elif "--resonant" in arguments:
        write(REPORT, _read_csv(REPORT / "orders.csv", Row), _passages(), _read_csv(REPORT / "cost.csv", Cost))
    else:
        write(REPORT, _measured(CASES, None, measure), _passages(), list(costs()))


if __name__ == "__main__":
    main(sys.argv[1:])
