"""The opening page: when averaging pays, and the regime map as a table that names methods and times."""

from collections.abc import Callable, Sequence
from html import escape
from math import isnan
from pathlib import Path

from polhode.harness.analysis.regime_map import Cell, usual_form
from polhode.harness.common.text import duration, factor, short
from polhode.harness.pages.figures.map_picture import ERRORS, HEADINGS
from polhode.harness.pages.figures.style import colour, rank
from polhode.harness.pages.regimes import read_cells
from polhode.harness.site.markup import prose, scroll

TITLE = "What should I run?"
LEAD = (
    "For a massive ellipsoid in simple shear flow: which form of the equations, which solver, at what cost, as the "
    "Stokes number St grows and the error allowed shrinks. For a scene of your own: "
    "`polhode pick ice.toml --error 1e-6 --want slow`."
)
NOTE = (
    "The map as a table: the cheapest method, its time, and by what factor it leads; = names a method that ties with "
    "it. Averaged forms stand under their own name, whichever solver runs them. “none”: no run measured gets there. "
    "“unknown”: no reference is good enough."
)
# Letters of a name that may be broken at its hyphens.
LONG = 12


def maps(path: Path) -> Callable[[str], str]:
    """The maps in `cells.csv` as tables, by the name of the picture of the same scene."""
    found = read_cells(path) if path.is_file() else {}

    def drawn(picture: str) -> str:
        own = {error: cells for (scene, error), cells in found.items() if picture == f"{scene}.png"}
        parts = (
            f'<section class="region"><h3>{prose(ERRORS[error][1].replace("$I_{max}$", "I_max"))}</h3>'
            f"{_key(cells)}{_map(cells)}</section>"
            for error, cells in own.items()
        )
        return f"<p>{NOTE}</p>{''.join(parts)}" if own else ""

    return drawn


def _key(found: Sequence[Cell]) -> str:
    """Colours by kind, and the form that full equations are run in."""
    winners = {cell.winner.label: cell.winner.side for cell in found if cell.winner}
    lines = []
    for side, (_, kind) in HEADINGS.items():
        own = sorted((name for name in winners if winners[name] == side), key=rank)
        marks = "".join(f'<span style="--c:{colour(name)}">{escape(name)}</span>' for name in own)
        lines += [f'<p class="key"><b>{kind}</b>{marks}</p>'] if own else []
    note = f"Full equations in the form {usual_form(found)}, unless a cell names another."
    return f"{''.join(lines)}<p class=note>{note}</p>"


def _map(found: Sequence[Cell]) -> str:
    numbers = sorted({cell.stokes for cell in found})
    targets = sorted({cell.target for cell in found}, reverse=True)
    at = {(cell.stokes, cell.target): cell for cell in found}
    usual = usual_form(found)
    head = "".join(f"<th scope=col>{prose(short(stokes))}</th>" for stokes in numbers)
    rows = "".join(
        f"<tr><th scope=row>{prose(short(target))}</th>"
        f"{''.join(_cell(at[stokes, target], usual) for stokes in numbers)}</tr>"
        for target in targets
    )
    corner = "<th class=axis>error ↓ St →</th>"
    return scroll(f"<table class=map><thead><tr>{corner}{head}</tr></thead><tbody>{rows}</tbody></table>")


def _cell(cell: Cell, usual: str) -> str:
    if cell.winner is None:
        words = "none" if cell.known else "unknown"
        tip = "no run measured gets there" if cell.known else "below what the reference resolves"
        return f'<td class="none" title="{tip}">{words}</td>'
    label, time = cell.winner.label, duration(cell.seconds)
    name = f"<b{' class=long' if len(label) > LONG else ''}>{escape(label)}</b>"
    form = "" if cell.winner.side == "averaged" or cell.winner.form == usual else f"<i>{escape(cell.winner.form)}</i>"
    lead = (
        f" ={cell.second.label}" if cell.tied and cell.second else "" if isnan(cell.lead) else f" {factor(cell.lead)}"
    )
    tip = escape(f"{cell.winner}: {time}; next: {cell.second or 'none'}")
    return f'<td style="--c:{colour(label)}" title="{tip}">{name}{form}<span>{time}{escape(lead)}</span></td>'
