"""The page of the study of second-order averaging: what was found, its figure, and the tables it rests on."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from polhode.harness.averaging import cases, orders, second_order
from polhode.harness.averaging.data import Cost, SecondOrderErrors, SecondOrderStudy, write_study
from polhode.harness.averaging.findings import findings
from polhode.harness.averaging.orders import Slope, slopes
from polhode.harness.common.files import write_file
from polhode.harness.common.machine import header
from polhode.harness.common.tables import write_table
from polhode.harness.pages.figures.averaging import Line, against_stokes
from polhode.harness.pages.figures.work_precision import save
from polhode.harness.pages.tables import bullets, fill, table
from polhode.models.scene import EulerStart
from polhode.models.second_order.form import STOPS, SecondOrder


def write_page(study: SecondOrderStudy, folder: Path, command: str) -> None:
    """Write the page, its figure and its data into a folder."""
    write_study(study, folder)
    fitted = slopes(study.orders)
    write_table(folder / "slopes.csv", Slope, fitted)
    save(against_stokes(_panels(study.orders), "error over $I_{max}$, or in rad"), folder, "errors")
    write_file(folder / "README.md", page(study, fitted, command))


def page(study: SecondOrderStudy, fitted: Sequence[Slope], command: str) -> str:
    """The report as Markdown."""
    return fill(
        "second-order",
        header=header("Second-order averaging: orders and cost", command, list(study.timed.values())),
        findings=bullets(findings(study)),
        orders=table(_rows(study.orders, fitted), "second-order-slopes"),
        cost=_costs(study.cost, study.timed["cost"]["repeats"]) if study.cost else "",
        measured=second_order,
        fitted=orders,
        starts="; ".join(f"*{name}*, {_euler(start)}" for name, start in cases.NAMED.items()),
        tilted=cases.TILTED,
        stops=STOPS,
        repeats=study.timed["passages"]["repeats"],
    )


def _panels(rows: Sequence[SecondOrderErrors]) -> dict[str, list[Line]]:
    """Slow errors of both orders, and the orientation's, which second order alone knows."""
    found = [[row for row in rows if _case(row) == case] for case in dict.fromkeys(map(_case, rows))]
    slow = [
        Line(order, order, [row.stokes for row in own], [getattr(row, name) for row in own])
        for own in found
        for order, name in ((1, "first_order_slow"), (2, "slow"))
    ]
    turned = [Line(2, 1, [row.stokes for row in own], [row.orientation for row in own]) for own in found]
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


def _euler(start: EulerStart) -> str:
    angles, rates = (", ".join(f"{x:.4g}" for x in group) for group in (start.angles, start.rates))
    return f"θ, φ, ψ = {angles} and θ̇, φ̇, ψ̇ = {rates}"


def _costs(cost: Sequence[Cost], repeats: int) -> str:
    second = [each for each in cost if each.form == SecondOrder.name]
    first, last = (pick(second, key=lambda each: each.stokes) for pick in (min, max))
    compared = [each for each in cost if each.stokes == second_order.COMPARED]
    runs = table(dict.fromkeys([first, *compared, last]), "second-order-cost")
    return fill("second-order-cost", measured=second_order, runs=runs, repeats=repeats)
