"""The accuracy of the averaged forms as a table for the terminal, as JSON, and as a page with figure and data."""

import csv
from collections.abc import Sequence
from dataclasses import asdict
from itertools import cycle
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Any

from polhode.harness.accuracy import (
    FITTED_FROM,
    SLOW_TIME,
    SOLVER,
    TARGETS,
    TOLERANCE,
    VARIABLES,
    Law,
    Measured,
    first_order,
    laws,
    statements,
)
from polhode.harness.figures import save
from polhode.harness.machine import versions
from polhode.harness.text import aligned, markdown, scientific

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ERRORS_HEADER = [
    "case",
    "form",
    "St",
    "to t₂",
    *(f"model {name}" for name in VARIABLES),
    "model",
    "solver",
    "reference",
]
LAWS_HEADER = ["case", "form", *(f"order {name}" for name in VARIABLES), "order", "95 % interval"]
LAWS_HEADER += [f"St for {target:g}" for target in TARGETS]

# Okabe and Ito's palette, safe for colour-blind readers.
COLORS = ("#000000", "#D55E00", "#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7A7A7A")


def as_text(rows: Sequence[Measured]) -> str:
    """Both tables and the statements, for a terminal."""
    parts = [
        aligned(ERRORS_HEADER, [_error_row(row) for row in rows]),
        aligned(LAWS_HEADER, law_rows(rows)),
        "\n".join(statements(rows)),
    ]
    return "\n\n".join(parts)


def as_json(rows: Sequence[Measured]) -> dict[str, Any]:
    """Errors, laws and statements as plain data."""
    return {
        "variables": list(VARIABLES),
        "errors": [asdict(row) | {"model_error": row.model_error, "solver_error": row.solver_error} for row in rows],
        "laws": [
            asdict(law)
            | {
                "order": _number(law.order),
                "order_interval": [_number(end) for end in law.order_interval],
                "stokes_for": {f"{target:g}": _need(law, target) for target in TARGETS},
            }
            for law in laws(rows)
        ],
        "statements": statements(rows),
    }


def write_page(rows: Sequence[Measured], folder: Path, command: str) -> Path:
    """Write the page, its figure and its data into a folder and return the page's path."""
    folder.mkdir(parents=True, exist_ok=True)
    _write_csv(rows, folder / "errors.csv")
    save(figure(rows), folder, "errors")
    page = folder / "README.md"
    page.write_text("\n".join(_lines(rows, command)), encoding="utf-8")
    return page


def figure(rows: Sequence[Measured]) -> Any:
    """Model error against St, spheroids beside ellipsoids, over a line of slope -1."""
    import matplotlib.pyplot as plt

    drawing, panels = plt.subplots(1, 2, figsize=(11.0, 5.4), sharex=True, sharey=True)
    for axes, family in zip(panels, ("spheroid", "ellipsoid"), strict=True):
        _panel(axes, [law for law in laws(rows) if law.family == family])
        axes.set_title({"spheroid": "spheroids", "ellipsoid": "triaxial ellipsoids"}[family], fontsize=11)
        axes.set_xlabel("Stokes number St")
    panels[0].set_ylabel("largest error of L and E along the run, over $I_{max}$")
    drawing.tight_layout()
    return drawing


def _panel(axes: "Axes", own: Sequence[Law]) -> None:
    colors = dict(zip(dict.fromkeys(law.subject for law in own), cycle(COLORS), strict=False))
    for law in own:
        second = not first_order(law.form)
        axes.loglog(
            law.stokes,
            law.error,
            color=colors[law.subject],
            label=None if second else law.subject,
            linestyle="--" if second else "-",
            linewidth=1.3,
            marker="s" if second else "o",
            markersize=4,
        )
    if any(not first_order(law.form) for law in own):
        axes.plot(
            [],
            [],
            color="0.3",
            linestyle="--",
            marker="s",
            markersize=4,
            label="the same, second order" + (" up to $L^2=2EI_2$" if own[0].family == "ellipsoid" else ""),
        )
    x = [1e2, 1e6]
    axes.loglog(x, [3e1 / s for s in x], color="0.6", linewidth=0.9, linestyle=":", label="30/St")
    for target in TARGETS:
        axes.axhline(target, color="0.88", linewidth=0.8, zorder=0)
    axes.legend(fontsize=8, frameon=False, loc="lower left")


def law_rows(rows: Sequence[Measured]) -> list[list[str]]:
    """One row per case and form: the orders per variable and of the slow error, and the St that errors need."""
    each = {name: {(law.subject, law.form): law for law in laws(rows, name)} for name in VARIABLES}
    table = []
    for law in laws(rows):
        orders = [each[name].get((law.subject, law.form)) for name in VARIABLES]
        low, high = law.order_interval
        interval = "–" if isnan(low) else f"{low:.2f} to {high:.2f}"
        needs = [_need(law, target) for target in TARGETS]
        table.append(
            [
                law.subject,
                law.form,
                *(_order(each_law.order if each_law else None) for each_law in orders),
                _order(law.order),
                interval,
                *(_sign(need["from"]) + f"{need['stokes']:.2g}" if need["stokes"] else "–" for need in needs),
            ]
        )
    return table


def _lines(rows: Sequence[Measured], command: str) -> list[str]:
    uncertainty = max(row.uncertainty for row in rows)
    return [
        "# How accurate the averaged equations are",
        "",
        f"Made by `{command}` with " + ", ".join(f"{name} {number}" for name, number in versions().items()) + ".",
        "Do not edit: the next run overwrites this page.",
        "",
        *(f"- {sentence}" for sentence in statements(rows)),
        "",
        "![Model error against St for spheroids and ellipsoids](errors.png)",
        "",
        f"Errors are maxima along the run, slow time 0 to {SLOW_TIME:g}, over the largest moment of inertia. The "
        "second order of averaging follows a triaxial ellipsoid up to L² = 2EI₂ alone: its rows say how far they go. "
        "Where a form refuses, or where its own exact solution could not be certified, there is no row. *Model*: "
        "the averaged equations' exact solution against the full equations'; *solver*: the averaged equations by "
        f"`{SOLVER}` at tolerance {TOLERANCE:g} against their exact solution, largest of the four variables. Every "
        "full solution is a certified reference: confirmed on at least "
        f"{min(row.pieces for row in rows)} pieces by another form and method; the largest *reference* uncertainty is "
        f"{scientific(uncertainty)}.",
        "",
        "## Order in 1/St, and the St that an error needs",
        "",
        f"Model error c/St^order, by least squares on logarithms from St = {FITTED_FROM:g} on, with the 95 % interval "
        "of the slow error's order. The St from which on the slow error (model) stays below a value: measured, `<` "
        "already at the smallest St measured, `~` beyond the largest one by the fitted law.",
        "",
        markdown(LAWS_HEADER, law_rows(rows), right=range(2, len(LAWS_HEADER))),
        "## Every error",
        "",
        "As CSV: [errors.csv](errors.csv).",
        "",
        markdown(ERRORS_HEADER, [_error_row(row) for row in rows], right=range(2, len(ERRORS_HEADER))),
    ]


def _write_csv(rows: Sequence[Measured], path: Path) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        columns = [f"{kind}_{name}" for kind in ("model", "solver") for name in VARIABLES]
        writer.writerow(
            ["case", "family", "form", "a", "b", "c", "St", "slow_time", *columns, "reference_uncertainty", "pieces"]
        )
        for row in rows:
            names = row.subject, row.family, row.form, *row.semi_axes, row.stokes, row.until
            writer.writerow([*names, *row.model, *row.solver, row.uncertainty, row.pieces])


def _error_row(row: Measured) -> list[str]:
    numbers = (*row.model, row.model_error, row.solver_error, row.uncertainty)
    return [row.subject, row.form, f"{row.stokes:.3g}", f"{row.until:.3g}", *(scientific(number) for number in numbers)]


def _need(law: Law, target: float) -> dict[str, Any]:
    stokes, source = law.needed(target)
    return {"stokes": _number(stokes), "from": source}


def _sign(source: str) -> str:
    return {"at most": "< ", "measured": "", "extrapolated": "~ "}[source]


def _order(order: float | None) -> str:
    return "–" if order is None or isnan(order) else f"{order:.2f}"


def _number(value: float) -> float | None:
    return None if isnan(value) else value
