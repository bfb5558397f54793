"""Which form when: tables for README and docs, from the cells of the regime maps.

`python -m polhode.harness.pages.which_form CELLS.csv PAGE.md ...` writes them into pages, between the
lines `<!-- which form -->` and `<!-- end of which form -->`.
"""

import re
import sys
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path

from polhode.harness.analysis.pareto import Cell
from polhode.harness.answers.averaging_laws import ORDERS
from polhode.harness.common.files import write_file
from polhode.harness.common.text import markdown, short
from polhode.harness.pages.regimes import Maps, read_cells

BEGIN = "<!-- which form -->\n"
END = "<!-- end of which form -->"
# Errors of the columns, for L and E and for the orientation.
_TARGETS = (1e-2, 1e-4, 1e-6)
_BODIES = {"ellipsoid": "a triaxial body", "spheroid": "a spheroid"}
_REQUESTED = {"slow_error": "L, E to", "orientation_error": "orientation to"}
_AVERAGED = {**ORDERS, "hybrid": "hybrid"}


def tables(maps: Maps) -> str:
    """One table for each kind of body: the best form by St and requested error."""
    return "\n".join(_table(maps, body) for body in _BODIES)


def _table(maps: Maps, body: str) -> str:
    words = dict[float, list[str]]()
    header = [f"St, {_BODIES[body]}"]
    for error, title in _REQUESTED.items():
        for target in _TARGETS:
            header.append(f"{title} {short(target)}")
            for cell in maps[body, error]:
                if cell.target == target:
                    words.setdefault(cell.stokes, []).append(winner_in_words(cell))
    rows = []
    for row, group in groupby(sorted(words), key=lambda stokes: words[stokes]):
        rows.append([_range([*group]), *row])
    return markdown(header, rows)


def winner_in_words(cell: Cell) -> str:
    """The equations that the cheapest method of a cell solves, and by what kind of solver."""
    if cell.winner is None:
        return "–"
    if cell.winner.form in _AVERAGED:
        return _AVERAGED[cell.winner.form]
    if cell.winner.side == "tailored":
        return "full, split"
    return "full, implicit" if cell.winner.side == "implicit" else "full"


def _range(stokes: Sequence[float]) -> str:
    first = short(stokes[0])
    return first if len(stokes) == 1 else f"{first} to {short(stokes[-1])}"


def with_tables(page: str, maps: Maps) -> str:
    """A page's text with the tables as they are today; ValueError where it has no place for them."""
    pattern = re.compile(f"{re.escape(BEGIN)}.*?{re.escape(END)}", re.DOTALL)
    if not pattern.search(page):
        raise ValueError(f"got a page without {BEGIN.strip()!r} and {END!r}")
    return pattern.sub(lambda _: f"{BEGIN}\n{tables(maps)}\n{END}", page)


def main(cells: str, *pages: str) -> None:
    """Write the tables into pages."""
    maps = read_cells(Path(cells))
    for name in pages:
        path = Path(name)
        write_file(path, with_tables(path.read_text(encoding="utf-8"), maps))


if __name__ == "__main__":
    main(*sys.argv[1:])
