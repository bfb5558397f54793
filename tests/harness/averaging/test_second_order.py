"""The study of second-order averaging: its rows come back from its files, its page tells what they say."""

import re
from dataclasses import replace
from math import isnan, nan

from click.testing import CliRunner
from commandline import runner

from polhode.harness.averaging import hybrid, second_order
from polhode.harness.averaging.cases import RESONANT
from polhode.harness.averaging.data import (
    Cost,
    Passage,
    SecondOrderErrors,
    SecondOrderStudy,
    read_study,
    write_study,
)
from polhode.harness.averaging.orders import slopes
from polhode.harness.averaging.second_order import (
    COST_REPEATS,
    costs,
    measure_passage,
    measure_study,
)
from polhode.harness.cli import polhode
from polhode.harness.commands.bench import ACCURACY_PARTS
from polhode.harness.common.files import SUMS
from polhode.harness.common.text import short
from polhode.harness.pages.averaging.second_order import findings, page, write_page

ROWS = [
    SecondOrderErrors(
        "1:1:2",
        "paper",
        0.1,
        stokes,
        1e2 / stokes**2,
        1 / stokes,
        1 / stokes,
        1.5e2 / stokes**2,
        8 / stokes,
        1e-17,
        1e-16,
    )
    for stokes in (1e4, 1e5, 1e6)
]
PASSED = Passage(
    "1:0.8:0.5", "ω", 0.1, 1e5, "(-3, 1)", 2e-4, 7e-6, 2e-5, 3.5e-4, 7e-3, 0.1, 0.03, 1.5, ""
)
REFUSED = Passage(
    "1:0.6:0.4",
    "ω",
    0.03,
    1e4,
    "",
    nan,
    nan,
    nan,
    nan,
    nan,
    nan,
    nan,
    nan,
    "St = 10000 is too small",
)
COST = [
    Cost("averaged-second-order", "taylor", 1e-9, 1e3, 11, 4e-4, 5e-4, nan),
    Cost("averaged-second-order", "taylor", 1e-9, 1e6, 11, 5e-4, 6e-4, 8e-9),
    Cost("averaged-spheroid", "taylor", 1e-9, 1e6, 11, 5e-5, 1e-4, 2e-5),
    Cost("spheroid-axis", "taylor", 1e-8, 1e6, 11, 0.4, 0.42, 4e-9),
    Cost("spheroid-axis", "cyrk-vern8", 1e-8, 1e6, 11, 0.2, 0.21, 4e-7),
]
HERE = {
    "date": "2026-05-04T03:02:01Z",
    "machine": {"processor": "abacus", "cores": 1, "system": "wood", "python": "3.11"},
    "versions": {"polhode": "0.1.0"},
    "repeats": 3,
}
TIMED = {"orders": HERE, "passages": HERE, "cost": HERE}


COMMAND = "polhode accuracy --order 2"
STUDY = SecondOrderStudy(ROWS, [PASSED], [REFUSED], COST, TIMED)


def test_data_come_back(tmp_path):
    write_study(STUDY, tmp_path)
    assert repr(read_study(SecondOrderStudy, tmp_path)) == repr(STUDY)


def test_the_page_shows_cases_and_costs(tmp_path):
    write_page(STUDY, tmp_path, COMMAND)
    text = (tmp_path / "README.md").read_text(encoding="utf-8")
    assert "Measured on 2026-05-04 by polhode 0.1.0, commit not kept, on abacus, 1 cores" in text
    (row,) = re.findall(r"\| 1:1:2 +\| paper .*", text)
    cells = [cell.strip() for cell in row.split("|")][3:-1]
    assert cells == ["-2.00", "-1.00", "1e6", "1.0e-10", "1.0e-6", "1.0e-6"]
    costs = re.findall(r"\| (\S+) +\| \S+ +\| +1e-[89] \| +(\S+) \|", text)
    assert sorted(costs) == sorted((each.form, short(each.stokes)) for each in COST)
    assert "the fastest of 3 runs; tables and compilation" in text
    assert (tmp_path / "errors.png").stat().st_size > 10_000
    assert "## Cost" not in page(replace(STUDY, cost=[]), slopes(ROWS), COMMAND)


def test_findings_are_those_of_the_numbers():
    orders, estimates, gains, crossings, there, steady, compared = findings(
        replace(STUDY, crossings=[replace(PASSED, slow=3.5e-5), REFUSED])
    )
    assert orders.startswith(
        "Spheroids, 1 starts: the error of L and E falls like St^-2.00 to St^-2.00"
    )
    assert (
        "away from resonances: 1.5 to 1.5 times the measured error of L and E, 8 to 8 times the "
        "measured error of the orientation" in estimates
    )
    assert "50 to 50 times smaller" in gains
    assert "10 to 10 times smaller" in crossings
    assert "Refused at all St: 1 of 2 runs" in crossings
    assert "0.57 to 2.9 times the measured error of L and E" in there
    assert "500 µs to 600 µs at St from 1000 to 1e6: at the largest St 1.20 times" in steady
    assert (
        "210 ms for an error of L and E of at most 1e-6 (`cyrk-vern8`, the fastest of 2 solvers), 350 times"
        in compared
    )
    assert findings(SecondOrderStudy([], [], [], [], {})) == []


def test_a_run_through_a_resonance_is_measured(monkeypatch):
    monkeypatch.setattr(second_order, "PASSAGE_REPEATS", 1)
    row = measure_passage(RESONANT[1], 1e4)
    assert row.modes == "(-4, 2)"
    assert row.slow < row.estimated_slow < row.first_order_slow / 5
    assert row.orientation < row.estimated_orientation
    assert 0 < row.integration < row.seconds


def test_one_part_is_measured_and_the_others_stay(monkeypatch):
    monkeypatch.setattr(second_order, "costs", lambda: iter(COST[:2]))
    monkeypatch.setattr(second_order, "AWAY", ())
    for part, rows in {"cost": COST[:2], "orders": []}.items():
        found = measure_study(STUDY, part, quiet=True)
        assert getattr(found, part) == rows
        assert found.timed[part].get("repeats") == {"cost": COST_REPEATS}.get(part)
        assert replace(found, **{part: getattr(STUDY, part)}, timed=TIMED) == STUDY


def test_the_commands_parts_are_the_studys():
    assert ACCURACY_PARTS == {
        "all": (),
        "2": second_order.SECOND_ORDER_PARTS,
        "hybrid": hybrid.HYBRID_PARTS,
    }


def test_costs_have_one_row_for_each_form_solver_and_st(monkeypatch):
    monkeypatch.setattr(second_order, "COST_REPEATS", 2)
    found = list(costs(exponents=(3, 4), compared=1e4))
    assert [(each.form, each.stokes) for each in found[:3]] == [
        ("averaged-second-order", 1e3),
        ("averaged-second-order", 1e4),
        ("averaged-spheroid", 1e4),
    ]
    assert len({(each.form, each.solver, each.stokes) for each in found}) == len(found) == 6
    assert all(0 < each.integration < each.seconds for each in found)
    assert isnan(found[0].slow)
    assert found[1].slow < found[2].slow / 10
    assert max(each.slow for each in found[3:]) <= 1e-6


def test_options_that_make_no_sense_are_one_line(tmp_path):
    def told(*options: str) -> str:
        outcome = CliRunner().invoke(polhode, ["accuracy", "--out", str(tmp_path), *options])
        assert outcome.exit_code == 2
        return outcome.output

    assert "orders.csv: No such file or directory, expected a table of shape" in told(
        "--order", "2", "--page-only"
    )
    assert "--quick, --part, --page-only, --restate: got several" in told(
        "--order", "2", "--page-only", "--part", "cost"
    )
    assert "--part: got --order all, expected --order 2" in told("--part", "cost")
    assert "--part: got --order 2, expected --order hybrid" in told(
        "--order", "2", "--part", "speed"
    )
    write_study(STUDY, tmp_path)
    (tmp_path / SUMS).unlink()
    (tmp_path / "cost.csv").write_text("form,solver\n")
    assert "cost.csv: got the columns form, solver, expected form, solver, tol" in told(
        "--order", "2", "--part", "cost"
    )


def test_the_page_alone_is_the_page_that_was_measured(tmp_path):
    write_study(STUDY, tmp_path)
    outcome = runner().invoke(
        polhode, ["accuracy", "--order", "2", "--page-only", "--out", str(tmp_path)]
    )
    assert outcome.exit_code == 0
    assert (tmp_path / "README.md").read_text(encoding="utf-8") == page(
        STUDY, slopes(ROWS), COMMAND
    )
    assert outcome.stdout.splitlines() == findings(STUDY)
