"""The page of the study of second-order averaging: what was found, and the tables it rests on."""

from collections.abc import Sequence
from dataclasses import asdict
from math import isnan
from pathlib import Path
from typing import Any

from polhode.harness.averaging.cases import NAMED, TILTED
from polhode.harness.averaging.data import Cost, Passage, SecondOrderErrors, SecondOrderStudy, Slope, write_second_order
from polhode.harness.averaging.findings import findings
from polhode.harness.averaging.orders import FLOORS, LARGEST_ERROR, slopes
from polhode.harness.averaging.second_order import (
    COMPARED,
    FEW,
    FULL_REPEATS,
    PASSAGE_SOLVER,
    SAMPLES,
    SLOW_TIME,
    SMALL_KICK,
    TARGET,
    TOLERANCE,
)
from polhode.harness.common.files import write_file
from polhode.harness.common.machine import header
from polhode.harness.common.text import duration, in_two_digits, markdown, scientific, short
from polhode.models.scene import EulerStart
from polhode.models.second_order.form import MEANINGLESS, STOPS, SecondOrder

DATA = ("orders", "slopes", "resonances", "crossings", "cost")


def write_page(study: SecondOrderStudy, folder: Path, command: str) -> None:
    """Write the page and its data into a folder."""
    write_second_order(study, slopes(study.orders), folder)
    write_file(folder / "README.md", page(study, command))


def as_text(study: SecondOrderStudy) -> str:
    """What was found, for a terminal."""
    return "\n".join(findings(study))


def as_json(study: SecondOrderStudy) -> dict[str, Any]:
    """All that was measured, as plain data."""
    return asdict(study)


def page(study: SecondOrderStudy, command: str) -> str:
    """The report as Markdown."""
    lines = [
        *header("Second-order averaging: orders and cost", command, list(study.timed.values())),
        "How the form works: [docs](../../docs/second-order.md). Data: "
        + ", ".join(f"[{name}]({name}.csv)" for name in DATA)
        + ".",
        "",
        "## What was found",
        "",
        *(f"- {sentence}" for sentence in findings(study)),
        "",
        "## How to read the tables",
        "",
        *_definitions(),
        "",
        "## Orders",
        "",
        f"Errors fitted as St^slope: the slow one where it lies below {LARGEST_ERROR:g} and above {FLOORS:g} times the "
        "reference's uncertainty, the orientation's over the top two decades of St. *Points*: how many St each "
        "slope rests on.",
        "",
        _slopes(slopes(study.orders)),
        "## Errors and the form's own estimates",
        "",
        _errors(study.orders),
        *_passages(study.resonances, study.crossings, study.timed["passages"]["repeats"]),
        *(_costs(study.cost, study.timed["cost"]["repeats"]) if study.cost else []),
    ]
    return "\n".join(lines)


def _definitions() -> list[str]:
    return [
        f"- Errors are maxima over {SAMPLES} equispaced samples up to the slow time t₂ = t/St, against the full "
        "equations in long double: *slow*, the largest of L and E over the largest moment of inertia I_max; "
        "*orientation*, in rad; from about 1 on the phase is lost. Each has beside it what the form estimates "
        "beforehand. *First order*: the slow error of `averaged` or `averaged-spheroid` in the same run.",
        "- *Axes*: a:b:c. *Start*: "
        + "; ".join(f"*{name}*, {_euler(start)}" for name, start in NAMED.items())
        + "; ω = (…), that angular velocity in body axes, and the orientation of the quaternion "
        + f"({', '.join(f'{x:g}' for x in TILTED)}), normalised. Angles in rad, rates over the shear rate.",
    ]


def _euler(start: EulerStart) -> str:
    angles, rates = (", ".join(f"{x:.4g}" for x in group) for group in (start.angles, start.rates))
    return f"θ, φ, ψ = {angles} and θ̇, φ̇, ψ̇ = {rates}"


def _slopes(fitted: Sequence[Slope]) -> str:
    header = ("axes", "start", "slope of the slow error", "points", "slope of the orientation error", "points")
    table = [
        (s.shape, s.start, f"{s.slow:.2f}", s.slow_points, f"{s.orientation:.2f}", s.orientation_points) for s in fitted
    ]
    return markdown(header, table, right=range(2, 6))


def _errors(rows: Sequence[SecondOrderErrors]) -> str:
    header = ("axes", "start", "t₂", "St", "slow", "slow estimated", "first order", "orientation",
              "orientation estimated")  # fmt: skip
    table = [
        (
            row.shape, row.start, f"{row.slow_time:.3g}", _stokes(row.stokes),
            *map(_number, (row.slow, row.estimated_slow, row.first_order_slow)),
            *map(_number, (row.orientation, row.estimated_orientation)),
        )
        for row in rows
    ]  # fmt: skip
    return markdown(header, table, right=range(2, 9))


def _passages(resonances: Sequence[Passage], crossings: Sequence[Passage], repeats: int) -> list[str]:
    return [
        "## Through resonances",
        "",
        "Starts whose runs pass k₁ν₁ + k₂ν₂ = 0, ν₁ and ν₂ being the frequencies of polhode and precession.",
        "",
        "- *Modes*: the (k₁, k₂) that the run passes, in its order. *None*: none is estimated to kick L by more "
        f"than {SMALL_KICK:g} times the error estimated.",
        "- *Kick*: what the strongest of them is estimated to give L over I_max, which averaging misses.",
        "- *Gain*: first order's slow error over the second's.",
        f"- *Time*: integration by `{PASSAGE_SOLVER}` to {short(TOLERANCE)} and the observables at {SAMPLES} times; "
        f"*integration*: that part alone. The fastest of {repeats} runs; tables and "
        "compilation, seconds once per shape and mode, are left out. Fewer output times take less: see *Cost*.",
        "",
        *_table(resonances),
        "## Up to L² = 2EI₂",
        "",
        "Starts that meet it. The form stops short of it: of "
        + ", ".join(f"{share:g}" for share in STOPS)
        + " of the time to it, the first that the form accepts at this St is the t₂ of the table.",
        "",
        *_table(crossings),
    ]


def _table(rows: Sequence[Passage]) -> list[str]:
    header = ("axes", "start", "t₂", "St", "modes", "kick", "slow", "slow estimated", "first order", "gain",
              "orientation", "orientation estimated", "time", "integration")  # fmt: skip
    table = [
        (
            row.shape, row.start, f"{row.slow_time:.3g}", _stokes(row.stokes), row.modes or "none",
            *map(_number, (row.kick, row.slow, row.estimated_slow, row.first_order_slow)),
            in_two_digits(row.first_order_slow / row.slow),
            *map(_number, (row.orientation, row.estimated_orientation)),
            duration(row.seconds), duration(row.integration),
        )
        for row in rows if not row.refused
    ]  # fmt: skip
    refused = [
        f"- {row.shape}, {row.start}, St = {_stokes(row.stokes)}, up to t₂ = {row.slow_time:g}: {row.refused}."
        for row in rows
        if row.refused
    ]
    if refused:
        meaning = f"*too small for this run* means that the slow error is estimated to be {MEANINGLESS:g} or more"
        refused = [f"Refused, where {meaning}:", "", *refused, ""]
    return [markdown(header, table, right=(2, 3, *range(5, 14))), *refused]


def _costs(cost: Sequence[Cost], repeats: int) -> list[str]:
    second = [each for each in cost if each.form == SecondOrder.name]
    compared = [each for each in cost if each.stokes == COMPARED]
    own = min(each.seconds for each in second if each.stokes == COMPARED)
    return [
        "## Cost",
        "",
        f"Axes 1:1:2, start *paper*, t₂ = {SLOW_TIME:g}, {FEW} output times. *Time* is integration and observables; "
        f"*integration* that part alone. The fastest of {repeats} runs, {FULL_REPEATS} of the full form; "
        "compilation is left out.",
        "",
        f"The second order at every St, by `{second[0].solver}` at tolerance {short(second[0].tolerance)}:",
        "",
        markdown(
            ("St", "time", "integration"),
            [(_stokes(each.stokes), duration(each.seconds), duration(each.integration)) for each in second],
            right=range(3),
        ),
        f"Beside it at St = {_stokes(COMPARED)}, first order, and the full form by three solvers, each at the loosest "
        f"tolerance that gives a slow error of at most {short(TARGET)}:",
        "",
        markdown(
            ("form", "solver", "tolerance", "slow error", "time", "integration", "times the second order's"),
            [
                (
                    each.form, each.solver, short(each.tolerance), scientific(each.slow),
                    duration(each.seconds), duration(each.integration), in_two_digits(each.seconds / own),
                )
                for each in compared
            ],
            right=range(2, 7),
        ),
    ]  # fmt: skip


def _stokes(stokes: float) -> str:
    return short(float(f"{stokes:.3g}"))


def _number(value: float) -> str:
    """Two digits: as they are near 1, else with a power of ten; a dash where there is none."""
    return f"{value:.2g}" if not isnan(value) and 0.1 <= abs(value) < 10 else scientific(value)
