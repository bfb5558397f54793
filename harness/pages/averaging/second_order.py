"""The page of the study of second-order averaging: what was found, its figure, and the tables it rests on."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from polhode.harness.averaging.cases import NAMED, TILTED
from polhode.harness.averaging.data import Cost, SecondOrderErrors, SecondOrderStudy, write_study
from polhode.harness.averaging.findings import findings
from polhode.harness.averaging.orders import FLOORS, LARGEST_ERROR, Slope, slopes
from polhode.harness.averaging.second_order import (
    COMPARED,
    FEW,
    FULL_REPEATS,
    PASSAGE_SOLVER,
    SAMPLES,
    SLOW_TIME,
    TARGET,
    TOLERANCE,
)
from polhode.harness.common.files import write_file
from polhode.harness.common.machine import header
from polhode.harness.common.tables import write_table
from polhode.harness.common.text import short
from polhode.harness.pages.figures.averaging import Line, against_stokes
from polhode.harness.pages.figures.work_precision import save
from polhode.harness.pages.tables import table
from polhode.models.scene import EulerStart
from polhode.models.second_order.form import STOPS, SecondOrder

ORDERS = {
    "axes": "{shape}",
    "start": "{start}",
    "slope, slow error": "{slow:.2f}",
    "slope, orientation": "{orientation:.2f}",
    "at St": "{stokes:short}",
    "slow error": "{error:error}",
    "first order's": "{first:error}",
    "orientation, rad": "{turned:error}",
}
COSTS = {
    "form": "{form}",
    "solver": "{solver}",
    "tolerance": "{tolerance:short}",
    "St": "{stokes:short}",
    "slow error": "{slow:error}",
    "time": "{seconds:time}",
    "integration": "{integration:time}",
}


def write_page(study: SecondOrderStudy, folder: Path, command: str) -> None:
    """Write the page, its figure and its data into a folder."""
    write_study(study, folder)
    fitted = slopes(study.orders)
    write_table(folder / "slopes.csv", Slope, fitted)
    save(against_stokes(_panels(study.orders), "error over $I_{max}$, or in rad"), folder, "errors")
    write_file(folder / "README.md", page(study, fitted, command))


def page(study: SecondOrderStudy, fitted: Sequence[Slope], command: str) -> str:
    """The report as Markdown."""
    return "\n".join(
        [
            *header("Second-order averaging: orders and cost", command, list(study.timed.values())),
            *(f"- {sentence}" for sentence in findings(study)),
            "",
            "Away from resonances, case by case: exponents of St, and the errors at the largest St of each case.",
            "",
            table(_rows(study.orders, fitted), ORDERS, left=2),
            "![Errors of first and second order against St](errors.png)",
            "",
            *(_costs(study.cost, study.timed["cost"]["repeats"]) if study.cost else []),
            "## How to read it",
            "",
            *_definitions(study),
            "",
            "How the form works: [docs](../../docs/second-order.md). Every run, with what the form estimates "
            "beforehand: away from resonances [orders](orders.csv) and their [slopes](slopes.csv), through "
            "[resonances](resonances.csv), up to L² = 2EI₂ [crossings](crossings.csv); [cost](cost.csv).",
            "",
        ]
    )


def _panels(rows: Sequence[SecondOrderErrors]) -> dict[str, list[Line]]:
    """Slow errors of both orders, and the orientation's, which second order alone knows."""
    cases = [[row for row in rows if (row.shape, row.start) == case] for case in dict.fromkeys(map(_case, rows))]
    slow = [
        Line(order, order, [row.stokes for row in own], [getattr(row, name) for row in own])
        for own in cases
        for order, name in ((1, "first_order_slow"), (2, "slow"))
    ]
    turned = [Line(2, 1, [row.stokes for row in own], [row.orientation for row in own]) for own in cases]
    return {"slow error: L and E": slow, "orientation error": turned}


def _case(row: SecondOrderErrors) -> tuple[str, str]:
    return row.shape, row.start


def _rows(rows: Sequence[SecondOrderErrors], fitted: Sequence[Slope]) -> list[dict[str, Any]]:
    last = {_case(row): row for row in sorted(rows, key=lambda row: row.stokes)}
    return [
        asdict(slope)
        | {"stokes": row.stokes, "error": row.slow, "first": row.first_order_slow, "turned": row.orientation}
        for slope in fitted
        for row in [last[slope.shape, slope.start]]
    ]


def _definitions(study: SecondOrderStudy) -> list[str]:
    stops = ", ".join(f"{share:g}" for share in STOPS)
    repeats = study.timed["passages"]["repeats"]
    return [
        f"- Errors are maxima over {SAMPLES} equispaced samples, against the full equations in long double: *slow*, "
        "the largest of L and E over the largest moment of inertia I_max; from about 1 on the phase of the orientation "
        f"is lost. Slopes of the slow error are fitted below {LARGEST_ERROR:g} and above {FLOORS:g} times the "
        "reference's uncertainty, those of the orientation over the top two decades of St.",
        "- *Axes*: a:b:c. *Start*: "
        + "; ".join(f"*{name}*, {_euler(start)}" for name, start in NAMED.items())
        + "; ω = (…), that angular velocity in body axes, and the orientation of the quaternion "
        + f"({', '.join(f'{x:g}' for x in TILTED)}), normalised. Angles in rad, rates over the shear rate.",
        "- Resonances are those of polhode and precession, k₁ν₁ + k₂ν₂ = 0; each gives L a kick, which averaging "
        f"misses. Up to L² = 2EI₂ the form goes to the first of {stops} of the time to it that it accepts. Times of "
        f"both: integration by `{PASSAGE_SOLVER}` to {short(TOLERANCE)} and the observables at {SAMPLES} times, the "
        f"fastest of {repeats} runs; tables and compilation, once per shape and mode, are left out.",
    ]


def _euler(start: EulerStart) -> str:
    angles, rates = (", ".join(f"{x:.4g}" for x in group) for group in (start.angles, start.rates))
    return f"θ, φ, ψ = {angles} and θ̇, φ̇, ψ̇ = {rates}"


def _costs(cost: Sequence[Cost], repeats: int) -> list[str]:
    second = [each for each in cost if each.form == SecondOrder.name]
    first, last = (pick(second, key=lambda each: each.stokes) for pick in (min, max))
    compared = [each for each in cost if each.stokes == COMPARED]
    return [
        "## Cost",
        "",
        f"Axes 1:1:2, start *paper*, t₂ = {SLOW_TIME:g}, {FEW} output times; *time* is *integration* and observables, "
        f"the fastest of {repeats} runs, {FULL_REPEATS} of the full form, without compilation. Each full solver at the "
        f"loosest tolerance that gives a slow error of at most {short(TARGET)}.",
        "",
        table(dict.fromkeys([first, *compared, last]), COSTS, left=2),
    ]
