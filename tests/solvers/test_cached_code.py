import os
import sqlite3
import stat
import subprocess
import sys
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from polhode.solvers.machine_code import cached_code

CODE = """
from polhode.models.problem import Problem
from polhode.solvers.solve import solve

def decay(ops):
    return lambda y, p: (-p[0] * y[0],)

print(solve(Problem("decay", decay, (1.0,), 1.0, (1.0,)), "taylor", 1e-3).states[-1, 0])
"""


KILLED = "import os\nfrom polhode.solvers.compile import load_heyoka\nload_heyoka()\nos._exit(0)"


def run(cache: Path, code: str = CODE) -> tuple[str, str]:
    words = [sys.executable, "-P", "-c", code]
    variables = {**os.environ, "POLHODE_CACHE": str(cache)}
    done = subprocess.run(
        words, env=variables, capture_output=True, text=True, timeout=60, check=True
    )
    return done.stdout, done.stderr


def test_code_with_a_flipped_bit_is_dropped_and_compiled_anew(tmp_path: Path):
    folder = tmp_path / "heyoka"
    database = folder / "cache.db"
    expected = run(tmp_path)
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert (folder / "sums.json").exists()
    assert run(tmp_path) == expected == (expected[0], "")
    # What a killed process left is counted by the next one as it starts.
    sums = (folder / "sums.json").read_text()
    (folder / "sums.json").unlink()
    run(tmp_path, KILLED)
    assert (folder / "sums.json").read_text() == sums
    (folder / "sums.json").write_text("[]")
    assert run(tmp_path) == expected
    with closing(sqlite3.connect(database)) as kept:
        key, code = kept.execute("SELECT hash, obj FROM cache").fetchone()
        flipped = bytes([code[0] ^ 1]) + code[1:]
        kept.execute("UPDATE cache SET obj = ? WHERE hash = ?", (flipped, key))
        kept.commit()
    for reason in ("a checksum does not match", "file is not a database"):
        complaint = f"polhode: {folder}: damaged ({reason}), compiled anew\n"
        assert run(tmp_path) == (expected[0], complaint)
        assert run(tmp_path) == expected
        database.write_bytes(b"no database")


def cached(folder: Path) -> Path:
    """A database of machine code with one entry."""
    database = folder / "cache.db"
    with closing(sqlite3.connect(database)) as kept:
        kept.execute("CREATE TABLE cache (hash INTEGER, obj BLOB)")
        kept.execute("INSERT INTO cache VALUES (1, x'c3')")
        kept.commit()
    return database


def test_a_database_that_another_process_holds_is_not_taken_for_damaged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    database = cached(tmp_path)
    # No wait for the other one: SQLite's own limit is 5 s.
    connect = sqlite3.connect
    monkeypatch.setattr(sqlite3, "connect", partial(connect, timeout=0))
    with closing(connect(database)) as other:
        other.execute("BEGIN EXCLUSIVE")
        assert not cached_code.check(tmp_path)
    assert database.exists()
    assert cached_code.check(tmp_path)
    assert capsys.readouterr().err == ""


def test_an_entry_that_another_process_drops_meanwhile_gets_no_checksum(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    database = cached(tmp_path)

    class Dropping(sqlite3.Connection):
        def execute(self, sql: str, *parameters: Any) -> sqlite3.Cursor:
            if "WHERE hash" in sql:
                with closing(connect(database)) as other:
                    other.execute("DELETE FROM cache")
                    other.commit()
            return super().execute(sql, *parameters)

    connect = sqlite3.connect
    monkeypatch.setattr(sqlite3, "connect", partial(connect, factory=Dropping))
    cached_code.note(tmp_path)
    assert not (tmp_path / "sums.json").exists()


def test_text_that_is_no_text_counts_as_damage(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    database = cached(tmp_path)
    with closing(sqlite3.connect(database)) as kept:
        kept.execute("UPDATE cache SET obj = CAST(x'ff80' AS TEXT)")
        kept.commit()
    assert cached_code.check(tmp_path)
    assert not database.exists()
    assert "damaged (Could not decode to UTF-8 column" in capsys.readouterr().err
