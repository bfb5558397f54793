"""Tables come back as they were written."""

from dataclasses import dataclass
from pathlib import Path

import pytest

from polhode.harness.common.store import read_table, write_table


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
    (tmp_path / "cut.csv").write_text("name,count,error\na,1\n")
    with pytest.raises(ValueError, match="got rows of other lengths, expected 3 cells in each"):
        read_table(tmp_path / "cut.csv", Measured)
