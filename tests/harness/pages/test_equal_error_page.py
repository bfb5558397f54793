"""What the libraries are worth and what the interpreter costs, of runs whose times are known."""

import pandas as pd
import pytest

from polhode.harness.analysis.frames import by_stokes
from polhode.harness.analysis.pareto import costs
from polhode.harness.pages.equal_error import COMPARED_ERRORS, _interpreter, _worth
from polhode.harness.pages.tables import table as shown


def runs(*rows: tuple[str, str | None, str | None, float, float, str]) -> pd.DataFrame:
    columns = ["solver", "backend", "jacobian", "seconds", "slow_error", "status"]
    return pd.DataFrame(rows, columns=columns).assign(
        stokes=10.0, form="quaternion", slow_uncertainty=1e-15
    )


def cells(text: str, begin: str) -> list[str]:
    line = next(line for line in text.splitlines() if line.startswith(begin))
    return [cell.strip() for cell in line.strip("|").split("|")]


def test_each_library_by_its_fastest_method_alone():
    done, table = "reached_end", []
    for solver, seconds in (
        ("taylor", 2e-3),
        ("cyrk-vern8", 1e-3),
        ("cyrk-tsit5", 5e-3),
        ("dop853", 1e-5),
    ):
        table.append((solver, None, None, seconds, 1e-9, done))
    table += [
        ("cvode-bdf", None, None, 4e-3, 1e-7, done),
        ("cyrk-radau", None, None, 1e-6, 1e-9, "time_limit"),
    ]
    claims, text = _worth(costs(by_stokes(runs(*table)), COMPARED_ERRORS))
    assert cells(text, "| 1e-6") == [
        "1e-6",
        "10",
        "taylor, 2.0 ms",
        "cyrk-vern8, 1.0 ms",
        "cvode-bdf, 4.0 ms",
    ]
    assert cells(text, "| 1e-8") == ["1e-8", "10", "taylor, 2.0 ms", "cyrk-vern8, 1.0 ms", "–"]
    assert "CyRK, without the interpreter, is the fastest at 3 of 3 places" in "".join(claims)
    assert any(claim.endswith("at 3 of 3 places (St, error of L and E).") for claim in claims)
    assert "within 4 times the fastest at half of the 2 places that it reaches" in "".join(claims)


@pytest.mark.parametrize(
    ("solver", "alone", "jacobian", "other"),
    [
        ("dop853", "cyrk-dop853", None, None),
        ("radau", "cyrk-radau", "difference", "exact"),
        ("ida", "ida", "exact", "difference"),
    ],
)
def test_the_same_algorithm_in_three_ways(
    solver: str, alone: str, jacobian: str | None, other: str | None
):
    done, table = "reached_end", []
    for own, factor in ((jacobian, 1.0), (other, 100.0)) if other else ((jacobian, 1.0),):
        table += [
            (solver, "python", own, 30e-3 * factor, 1e-9, done),
            (solver, "numba", own, 20e-3 * factor, 1e-9, done),
        ]
        table.append((alone, "compiled", own, 2e-3 * factor, 1e-9, done))
    text = shown(_interpreter(runs(*table)), "equal-error-interpreter")
    assert cells(text, "| 10") == ["10", solver, "30 ms", "20 ms", "2.0 ms", "15.0", "10.0"]
    unfinished = runs(
        *(row if row[1] != "compiled" else (*row[:-1], "time_limit") for row in table)
    )
    assert (
        cells(shown(_interpreter(unfinished), "equal-error-interpreter"), "| 10")[4:] == ["–"] * 3
    )
