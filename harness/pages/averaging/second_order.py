"""The page of the study of second-order averaging: what was found, its figure, and the tables it rests on."""

from collections.abc import Sequence
from itertools import chain
from math import isnan
from pathlib import Path
from typing import Any

from polhode.harness.analysis.frames import frame_of
from polhode.harness.averaging import cases, orders, second_order
from polhode.harness.averaging.data import (
    Cost,
    Passage,
    SecondOrderErrors,
    SecondOrderStudy,
    write_study,
)
from polhode.harness.averaging.orders import Slope, slopes
from polhode.harness.common.files import write_file
from polhode.harness.common.machine import provenance
from polhode.harness.common.store import write_table
from polhode.harness.common.text import short
from polhode.harness.pages.figures.orders import Line, against_stokes
from polhode.harness.pages.figures.style import save
from polhode.harness.pages.tables import fill, lines_of
from polhode.models.second_order.form import STOPS, SecondOrder

# St at which errors of first and second order are compared; a choice.
_GAIN_AT = 1e5


def write_page(study: SecondOrderStudy, folder: Path, command: str) -> None:
    """Write the page, its figure and its data into a folder."""
    write_study(study, folder)
    fitted = slopes(study.orders)
    write_table(folder / "slopes.csv", Slope, fitted)
    by_case = frame_of(SecondOrderErrors, study.orders).groupby(["shape", "start"], sort=False)
    errors_by_case = [case_errors for _, case_errors in by_case]
    # Errors of L and E by each order, and of the orientation, which second order alone knows.
    panels = {
        "first order:\nL and E over $I_{max}$": _lines(errors_by_case, 1, 1, "first_order_slow"),
        "second order:\nL and E over $I_{max}$": _lines(errors_by_case, 2, 2, "slow"),
        "second order:\norientation, rad": _lines(errors_by_case, 2, 1, "orientation"),
    }
    note = (
        f"{len(errors_by_case)} starts away from resonances, a line each; by "
        f"{second_order.USUAL_SOLVER} at tolerance {short(second_order.SECOND_ORDER_TOLERANCE)} "
        "against the full equations in long double. No times are shown."
    )
    save(against_stokes(panels, "error", note), folder, "errors")
    write_file(folder / "README.md", page(study, fitted, command))


def _lines(cases_errors: Sequence[Any], order: int, power: int, name: str) -> list[Line]:
    """Errors of each case, from the column `name`, by an order of averaging: they fall like 1/St^power."""
    return [Line(order, power, errors["stokes"], errors[name]) for errors in cases_errors]


def page(study: SecondOrderStudy, fitted: Sequence[Slope], command: str) -> str:
    """The report as Markdown."""
    second = _of_second_order(study.cost)
    # Costs at the St at which all forms were timed.
    compared = [row for row in study.cost if row.stokes == second_order.COMPARED]
    # The slopes of each case, and the errors at its largest St.
    last = frame_of(SecondOrderErrors, study.orders).sort_values("stokes")
    last = last.drop_duplicates(["shape", "start"], keep="last")
    last = last.rename(
        columns={"slow": "error", "first_order_slow": "first", "orientation": "turned"}
    )
    return fill(
        "second-order",
        made=provenance(command, list(study.timed.values())),
        findings=findings(study),
        orders=frame_of(Slope, fitted).merge(last, on=["shape", "start"]).to_dict("records"),
        # The form's cost at its smallest St, all forms' costs at one St, the form's at its largest St: each
        # once. Templates take the study's numbers from the modules below.
        runs=dict.fromkeys([*second[:1], *compared, *second[-1:]]),
        timed=study.timed,
        measured=second_order,
        fitted=orders,
        cases=cases,
        stops=STOPS,
    )


def findings(study: SecondOrderStudy) -> list[str]:
    """Orders, estimates, gains and cost of the second order; nothing of what was not measured."""
    fitted = slopes(study.orders)
    passages = {"Through resonances": study.resonances, "Up to L² = 2EI₂": study.crossings}
    # `shape` is a:b:c: three different numbers.
    triaxial = [slope for slope in fitted if len(set(slope.shape.split(":"))) == 3]
    full = [
        cost
        for cost in study.cost
        if cost.form == "spheroid-axis" and cost.stokes == second_order.COMPARED
    ]
    # First order's errors over those of second order.
    gains = {}
    for title, rows in passages.items():
        compared = [row for row in rows if row.stokes == _GAIN_AT and not row.refused]
        gains[title] = [row.first_order_slow / row.slow for row in compared]
    return lines_of(
        "second-order-findings",
        fitted={
            "Spheroids": [slope for slope in fitted if slope not in triaxial],
            "Triaxial ellipsoids away from resonances and from L² = 2EI₂": triaxial,
        },
        away=_estimates(study.orders),
        there=_estimates([*chain.from_iterable(passages.values())]),
        gains=gains,
        stokes=_GAIN_AT,
        passages=passages,
        second=_of_second_order(study.cost),
        full=sorted(
            (cost for cost in full if cost.slow <= second_order.TARGET),
            key=lambda cost: cost.seconds,
        ),
        measured=second_order,
    )


def _of_second_order(costs: Sequence[Cost]) -> list[Cost]:
    """Costs of the form itself, by St."""
    return sorted(
        (cost for cost in costs if cost.form == SecondOrder.name), key=lambda cost: cost.stokes
    )


def _estimates(rows: Sequence[SecondOrderErrors | Passage]) -> list[list[float]]:
    """Ratios of estimated to measured errors, of the slow variables and of the orientation; nothing without runs."""
    measured = [row for row in rows if not isnan(row.slow)]
    if not measured:
        return []
    slow = [row.estimated_slow / row.slow for row in measured]
    orientation = [row.estimated_orientation / row.orientation for row in measured]
    return [sorted(slow), sorted(orientation)]
