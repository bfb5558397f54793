"""Fits of numbers whose law is known, and intervals against published ones."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from polhode.harness.common.fits import power_law, share_interval
from polhode.harness.common.tables import read_table, write_table


def test_a_power_law_is_found_within_its_interval():
    x = np.geomspace(1.0, 1e4, 9)
    exact = power_law(x, 3 * x**-1.5)
    assert exact == pytest.approx((-1.5, -1.5, -1.5, 3.0))
    noise = np.exp(0.1 * np.random.default_rng(1).standard_normal(9))
    found = power_law(x, 3 * x**-1.5 * noise)
    assert found.low < -1.5 < found.high
    assert power_law([1.0, 2.0], [1.0, 4.0])[:3] == (pytest.approx(2.0), -np.inf, np.inf)


def test_wilsons_interval():
    """Against Newcombe, Stat. Med. 17 (1998) 857, table I, method 3."""
    assert share_interval(81, 263) == pytest.approx((0.2553, 0.3662), abs=5e-5)
    assert share_interval(0, 20) == pytest.approx((0.0, 0.1611), abs=5e-5)


@dataclass(frozen=True)
class Measured:
    """A row."""

    name: str
    count: int
    error: float


def test_a_table_comes_back(tmp_path: Path):
    rows = [Measured("a, b", 1, 0.1 + 0.2), Measured("c", 2, float("inf"))]
    write_table(tmp_path / "rows.csv", Measured, rows)
    assert read_table(tmp_path / "rows.csv", Measured) == rows
    (tmp_path / "short.csv").write_text("name,count\na,1\n")
    with pytest.raises(ValueError, match="got the columns name, count, expected"):
        read_table(tmp_path / "short.csv", Measured)
