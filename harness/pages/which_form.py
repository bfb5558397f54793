"""Which form when: tables for README and docs, from the cells of the regime maps.

`python -m polhode.harness.pages.which_form CELLS.csv PAGE.md ...` writes them into pages, between the
lines `<!-- which form -->` and `<!-- end of which form -->`. `reports/regimes/cells.csv` has the cells, of
one body and start of each kind. An averaged form is named only from the St on from which 97.5 % of random
bodies meet the error by it (`averaging_laws.met_from`); before, the next method of the cell is.
`polhode.harness.pages.averaging.random_bodies.which_form` makes the table over random bodies, further down in
README.
"""

import re
import sys
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path

from polhode.harness.analysis.pareto import Method
from polhode.harness.analysis.regime_map import Cell
from polhode.harness.answers.averaging_laws import ORDER_TWO, ORDERS, TURNED, met_from
from polhode.harness.common.files import write_file
from polhode.harness.common.text import markdown, short
from polhode.harness.pages.regimes import Maps, read_cells

# Lines of a page around the tables.
BEGIN = "<!-- which form -->\n"
END = "<!-- end of which form -->"
# Requested errors of the columns: of L and E over I_max, and of the orientation in rad. The maps
# have more of them; which three to show is a choice.
_TARGETS = (1e-2, 1e-4, 1e-6)
# Words for the scenes of the maps, by the scene's name, and for the two kinds of error, by their column.
_BODIES = {"ellipsoid": "a triaxial body", "spheroid": "a spheroid"}
_REQUESTED = {"slow_error": "L, E to", "orientation_error": "orientation to"}
# Kinds of random bodies that an averaged form must serve, by the scene's name.
_KINDS = {"ellipsoid": ("stays", "resonance", "crosses"), "spheroid": ("prolate", "oblate")}
# Words for forms that average, by the form's name. The tables name no solver beside them.
_AVERAGING_FORMS = {**ORDERS, "hybrid": "hybrid"}


def tables(maps: Maps) -> str:
    """One table for each kind of body: the best form by St and requested error."""
    return "\n".join(_table(maps, body) for body in _BODIES)


def _table(maps: Maps, body: str) -> str:
    """The table of one kind of body, a key of `_BODIES`."""
    # By St the words of a row of the table, one for each column.
    words_of_row = dict[float, list[str]]()
    header = [f"St, {_BODIES[body]}"]
    for error, title in _REQUESTED.items():
        for target in _TARGETS:
            header.append(f"{title} {short(target)}")
            for stokes, column in _columns(maps[body, error]).items():
                method = _trusted(column, target, body, error)
                words_of_row.setdefault(stokes, []).append(in_words(method))
    # Neighbouring St with the same words share a row.
    rows = []
    for words, group in groupby(sorted(words_of_row), key=lambda stokes: words_of_row[stokes]):
        rows.append([_range([*group]), *words])
    return markdown(header, rows)


def _columns(panel: Sequence[Cell]) -> dict[float, list[Cell]]:
    """The cells of a panel by St, those of the loosest error first."""
    columns = dict[float, list[Cell]]()
    for cell in sorted(panel, key=lambda cell: -cell.target):
        columns.setdefault(cell.stokes, []).append(cell)
    return columns


def _trusted(column: Sequence[Cell], target: float, body: str, error: str) -> Method | None:
    """The cheapest method of a column of cells that meets a requested error, of random bodies too; None without one.

    A method that meets a tighter error meets the requested one.
    """
    for cell in column:
        if cell.target > target:
            continue
        if cell.winner is None:
            return None
        for method in (cell.winner, cell.second):
            if method is not None and cell.stokes >= _met_from(method, target, body, error):
                return method
    return None


def _met_from(method: Method, target: float, body: str, error: str) -> float:
    """St from which on random bodies meet an error by a method; 0 if it does not average the whole run."""
    if method.form not in ORDERS:
        return 0.0
    name = ORDERS[method.form]
    if error == "orientation_error":
        # Second order alone has an orientation.
        assert name == ORDER_TWO
        name = TURNED
    return max(met_from(name, kind, target) for kind in _KINDS[body])


def in_words(method: Method | None) -> str:
    """The equations that a method solves; if full, also the kind of solver.

    "split" stands for the solvers made for large St, `splitting` and `stroboscopic`; an explicit
    solver has no word.
    """
    if method is None:
        return "–"
    if method.form in _AVERAGING_FORMS:
        return _AVERAGING_FORMS[method.form]
    if method.side == "tailored":
        return "full, split"
    return "full, implicit" if method.side == "implicit" else "full"


def _range(stokes: Sequence[float]) -> str:
    """Ascending St as "first to last", or the only one."""
    first = short(stokes[0])
    return first if len(stokes) == 1 else f"{first} to {short(stokes[-1])}"


def with_tables(page: str, maps: Maps) -> str:
    """A page's text with the tables of the maps between the lines `BEGIN` and `END`.

    Raises ValueError if the page lacks these lines.
    """
    pattern = re.compile(f"{re.escape(BEGIN)}.*?{re.escape(END)}", re.DOTALL)
    if not pattern.search(page):
        raise ValueError(f"got a page without {BEGIN.strip()!r} and {END!r}")
    # A function gives the new text, as `sub` would read backslashes in a string.
    return pattern.sub(lambda _: f"{BEGIN}\n{tables(maps)}\n{END}", page)


def main(cells: str, *pages: str) -> None:
    """Write the tables of a file of cells into files of pages."""
    maps = read_cells(Path(cells))
    for name in pages:
        path = Path(name)
        write_file(path, with_tables(path.read_text(encoding="utf-8"), maps))


if __name__ == "__main__":
    main(*sys.argv[1:])
