"""Orders and cost of `averaged-second-order`: ``python -m polhode.harness.averaging.study [--help]``.

Writes `README.md` and its data (orders, slopes, resonances, crossings, cost, and what measured the times) under
`reports/second-order`.
"""

import argparse
import csv
import json
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any, get_type_hints

from polhode.harness.averaging import resonances as resonant
from polhode.harness.averaging import second_orders as orders
from polhode.harness.averaging.cases import Case
from polhode.harness.averaging.cost import REPEATS, Cost, costs
from polhode.harness.averaging.resonances import ResonantRow
from polhode.harness.averaging.second_orders import Row, Slope, slopes
from polhode.harness.common.machine import machine, now, versions
from polhode.harness.common.store import Record
from polhode.harness.pages.second_order import page

REPORT = Path("reports/second-order")
# When and where the times were measured, those of the resonant runs and those of the costs.
TIMED = "timed.json"


@dataclass(frozen=True)
class Results:
    """All that the page tells.

    Parameters
    ----------
    rows : sequence of Row
        Runs away from resonances.
    resonances, crossings : sequence of ResonantRow
        Runs through resonances, and those up to L² = 2EI₂.
    cost : sequence of Cost
    timed : dict
        By "passages" and "cost": date, machine and versions of their times, and of how many runs each is the fastest.
    """

    rows: Sequence[Row]
    resonances: Sequence[ResonantRow]
    crossings: Sequence[ResonantRow]
    cost: Sequence[Cost]
    timed: dict[str, Record]


def write(directory: Path, results: Results) -> None:
    """Write data and page."""
    directory.mkdir(parents=True, exist_ok=True)
    fitted = slopes(results.rows)
    _write_csv(directory / "orders.csv", Row, results.rows)
    _write_csv(directory / "slopes.csv", Slope, fitted)
    _write_csv(directory / "resonances.csv", ResonantRow, results.resonances)
    _write_csv(directory / "crossings.csv", ResonantRow, results.crossings)
    _write_csv(directory / "cost.csv", Cost, results.cost)
    (directory / TIMED).write_text(json.dumps(results.timed, indent=2) + "\n", encoding="utf-8")
    written = page(results.rows, fitted, results.resonances, results.crossings, results.cost, results.timed)
    (directory / "README.md").write_text(written, encoding="utf-8")


def read(directory: Path) -> Results:
    """Read back what `write` wrote.

    Raises
    ------
    ValueError
        If a file is missing or lacks a column.
    """
    try:
        timed = json.loads((directory / TIMED).read_text(encoding="utf-8"))
        rows = _read_csv(directory / "orders.csv", Row)
        resonances = _read_csv(directory / "resonances.csv", ResonantRow)
        crossings = _read_csv(directory / "crossings.csv", ResonantRow)
        return Results(rows, resonances, crossings, _read_csv(directory / "cost.csv", Cost), timed)
    except OSError as error:
        raise ValueError(f"{error.filename}: {error.strerror}, expected the data that the study writes") from None


def _write_csv(path: Path, kind: type, rows: Sequence[Any]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [entry.name for entry in fields(kind)], lineterminator="\n")
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)


def _read_csv(path: Path, kind: type) -> list[Any]:
    readers: dict[str, Callable[[str], Any]] = get_type_hints(kind)
    with path.open(newline="", encoding="utf-8") as file:
        table = csv.DictReader(file)
        missing = [name for name in readers if name not in (table.fieldnames or ())]
        if missing:
            raise ValueError(f"{path}: got no column {missing[0]!r}, expected those that the study writes")
        return [kind(**{name: read(row[name]) for name, read in readers.items()}) for row in table]


def _measured(cases: Sequence[Case], points: int | None, take: Callable[[Case, float], Any]) -> list[Any]:
    return _told(take(case, float(f"{10**exponent:.3g}")) for case in cases for exponent in case.exponents[:points])


def _told(rows: Iterable[Any]) -> list[Any]:
    """The rows, each named on stderr as it comes."""
    found = []
    for row in rows:
        print(row, file=sys.stderr, flush=True)
        found.append(row)
    return found


def _passages(cases: int | None = None, points: int | None = None) -> tuple[list[ResonantRow], list[ResonantRow]]:
    return (
        _measured(resonant.CASES[:cases], points, resonant.measure),
        _measured(resonant.CROSSING[:cases], points, resonant.measure_crossing),
    )


def _here(repeats: int) -> Record:
    return {"date": now(), "machine": machine(), "versions": versions(), "repeats": repeats}


def _all_here() -> dict[str, Record]:
    return {"passages": _here(resonant.REPEATS), "cost": _here(REPEATS)}


def quick() -> Results:
    """One case of each kind, and no cost: a look."""
    return Results(
        _measured(orders.CASES[:1], 3, orders.measure), *_passages(1, 2), [], {"passages": _here(resonant.REPEATS)}
    )


def whole() -> Results:
    """Everything measured."""
    rows = _measured(orders.CASES, None, orders.measure)
    return Results(rows, *_passages(), _told(costs()), _all_here())


def passages_anew(old: Results) -> Results:
    """Runs through resonances and up to L² = 2EI₂ measured anew."""
    resonances, crossings = _passages()
    return replace(
        old, resonances=resonances, crossings=crossings, timed={**old.timed, "passages": _here(resonant.REPEATS)}
    )


def times_anew(old: Results) -> Results:
    """All times measured anew, no errors but those of the costs."""
    resonances, crossings = (
        _told(resonant.timed_anew(cases, rows))
        for cases, rows in ((resonant.CASES, old.resonances), (resonant.CROSSING, old.crossings))
    )
    return replace(
        old,
        resonances=resonances,
        crossings=crossings,
        cost=_told(costs()),
        timed=_all_here(),
    )


def main(arguments: Sequence[str]) -> None:
    """Run the study, or the part of it that an option names."""
    parser = argparse.ArgumentParser("python -m polhode.harness.averaging.study", description=__doc__)
    parser.add_argument("--out", type=Path, default=REPORT, help="folder (default: %(default)s)")
    part = parser.add_mutually_exclusive_group()
    part.add_argument("--quick", action="store_true", help="one case of each kind, no cost: a look, not a result")
    part.add_argument("--resonant", action="store_true", help="measure the runs through resonances anew, alone")
    part.add_argument("--times", action="store_true", help="measure the times anew, alone")
    part.add_argument("--page-only", action="store_true", help="measure nothing: write the page anew from its data")
    chosen = parser.parse_args(arguments)
    try:
        if chosen.resonant or chosen.times or chosen.page_only:
            old = read(chosen.out)
            results = passages_anew(old) if chosen.resonant else times_anew(old) if chosen.times else old
        else:
            results = quick() if chosen.quick else whole()
    except ValueError as error:
        parser.exit(2, f"{parser.prog}: {error}\n")
    write(chosen.out, results)


if __name__ == "__main__":
    main(sys.argv[1:])
