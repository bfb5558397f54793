"""The study of second-order averaging: its rows come back from its files, its page shows them."""

import re
from math import nan

from polhode.harness import second_order_study as study
from polhode.harness.second_order_resonances import CASES, ResonantRow, measure

ROWS = [
    study.Row("1:1:2", "paper", 0.1, stokes, 1e2 / stokes**2, 1 / stokes, 1 / stokes, 1 / stokes, nan, 1e-17, 1e-16)
    for stokes in (1e4, 1e5, 1e6)
]
PASSED = ResonantRow("1:0.8:0.5", "ω", 0.1, 1e5, "(-3, 1)", 2e-4, 7e-6, 2e-5, 3.5e-4, 7e-3, 0.1, 1.5, "")
REFUSED = ResonantRow("1:0.6:0.4", "ω", 0.03, 1e4, "", nan, nan, nan, nan, nan, nan, nan, "form: too small")


def test_rows_come_back(tmp_path):
    cost = [study.Cost("averaged", "taylor", 1e-9, 1e6, 11, 1e-3, nan)]
    study.write(tmp_path, ROWS, ([PASSED], [REFUSED]), cost)
    for name, kind, rows in (
        ("orders", study.Row, ROWS),
        ("resonances", ResonantRow, [PASSED]),
        ("crossings", ResonantRow, [REFUSED]),
        ("cost", study.Cost, cost),
    ):
        assert repr(study._read_csv(tmp_path / f"{name}.csv", kind)) == repr(rows)
    page = (tmp_path / "README.md").read_text(encoding="utf-8")
    assert re.search(r"\| +50 \|", page)
    assert "St = 1e+04: form: too small" in page
    assert re.search(r"\| +-2\.00 \|", page)


def test_a_resonant_row_is_measured():
    row = measure(CASES[1], 1e4)
    assert row.modes == "(-4, 2)"
    assert row.slow < row.estimated_slow < row.first_order_slow / 20
    assert row.orientation < row.estimated_orientation
