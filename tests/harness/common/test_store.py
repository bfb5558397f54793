"""The store: one row per case, whoever writes it, and never a damaged file overwritten."""

import csv
import gzip
import json
import os
import re
import sqlite3
import subprocess
import sys
import time
import tracemalloc
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, suppress
from datetime import UTC, datetime
from math import inf, isnan, nan
from pathlib import Path
from random import Random
from threading import Barrier

import pytest

from polhode.harness.analysis.frames import frame
from polhode.harness.common.store import (
    DamagedStoreError,
    Store,
    export,
    read_export,
    record_file,
    record_files,
    set_aside,
    write_records,
)

WRITER = """
import sys, time
from pathlib import Path
from polhode.harness.common.store import Store
path, name, first, last = sys.argv[1:]
with Store(Path(path)) as store:
    print("ready", flush=True)
    sys.stdin.readline()
    for number in range(int(first), int(last)):
        store.put(f"key{number}", {"number": number}, {"writer": name})
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "store.sqlite"


def test_records_come_back_in_the_order_of_writing(path: Path):
    with Store(path) as store:
        store.put(
            "b",
            {"tolerance": 1e-3, "form": "x"},
            {"seconds": 0.1 + 0.2, "error": None, "runs": [1, 2]},
        )
        store.put("a", {"tolerance": 1e-6}, {"seconds": inf, "flag": True})
    with Store(path) as store:
        assert store.keys() == {"a", "b"}
        assert ("a" in store, "c" in store) == (True, False)
        records = list(store)
        for record in records:
            assert (
                abs(datetime.now(UTC) - datetime.fromisoformat(record.pop("date"))).total_seconds()
                < 60
            )
        assert records == [
            {
                "key": "b",
                "tolerance": 1e-3,
                "form": "x",
                "seconds": 0.1 + 0.2,
                "error": None,
                "runs": [1, 2],
            },
            {"key": "a", "tolerance": 1e-6, "seconds": inf, "flag": True},
        ]


@pytest.mark.parametrize("version", [1, 9])
def test_a_store_of_another_version_is_left_alone(path: Path, version: int):
    filled(path)
    with closing(sqlite3.connect(path)) as connection:
        connection.execute(f"PRAGMA user_version = {version}")
    with pytest.raises(DamagedStoreError, match=f"got version {version} of the store, expected 2"):
        Store(path)


def test_no_single_flipped_bit_is_used_as_good(path: Path):
    filled(path)
    with Store(path) as store:
        true = list(store)
    content, random = path.read_bytes(), Random(5)
    for bit in random.sample(range(8 * len(content)), 60):
        damaged = bytearray(content)
        damaged[bit // 8] ^= 1 << bit % 8
        path.write_bytes(damaged)
        with suppress(DamagedStoreError), Store(path) as store:
            assert all(record in true for record in store)
        for beside in path.parent.glob("*-*"):
            beside.unlink()


def test_a_store_is_read_one_record_at_a_time(path: Path, tmp_path: Path):
    with Store(path) as store:
        for number in range(40):
            store.put(str(number), {"n": number}, {"text": "x" * 100_000})
        tracemalloc.start()
        for ending in ("csv", "jsonl", "jsonl.gz"):
            export(store, tmp_path / f"out.{ending}")
        assert tracemalloc.get_traced_memory()[1] < 1.5e6
        tracemalloc.stop()
    with (tmp_path / "out.csv").open(newline="", encoding="utf-8") as file:
        assert [row["n"] for row in csv.DictReader(file)] == [str(number) for number in range(40)]


def test_a_store_that_a_run_is_writing_is_not_set_aside(path: Path):
    filled(path)
    with Store(path) as store:
        with pytest.raises(OSError, match="a run is writing it, expected its end, --resume"):
            set_aside(path, path.with_name("previous.sqlite"))
        store.put("more", {}, {})
    set_aside(path, path.with_name("previous.sqlite"))
    assert [file.name for file in path.parent.iterdir()] == ["previous.sqlite"]
    with Store(path.with_name("previous.sqlite")) as store:
        assert len(store.keys()) == 21


def test_a_second_result_of_a_case_changes_nothing(path: Path):
    with Store(path) as store:
        store.put("a", {"form": "x"}, {"seconds": 1.0})
        store.put("a", {"form": "x"}, {"seconds": 2.0})
        assert [record["seconds"] for record in store] == [1.0]


def test_two_processes_write_at_once(path: Path):
    ranges = [("one", "0", "60"), ("two", "40", "100")]
    writers = [
        subprocess.Popen(
            [sys.executable, "-c", WRITER, path, *words],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        for words in ranges
    ]
    for writer in writers:
        assert writer.stdout is not None
        assert writer.stdout.readline() == "ready\n"
    for writer in writers:
        writer.communicate("go\n", timeout=60)
        assert writer.returncode == 0
    with Store(path) as store:
        records = list(store)
    assert sorted(record["number"] for record in records) == list(range(100))
    assert {record["writer"] for record in records if record["number"] < 40} == {"one"}
    assert {record["writer"] for record in records if record["number"] >= 60} == {"two"}


def test_several_runs_make_a_store_at_once(tmp_path: Path):
    start = Barrier(4)

    def run(path: Path) -> None:
        start.wait(60)
        Store(path).close()

    with ThreadPoolExecutor(4) as runs:
        for number in range(60):
            assert [*runs.map(run, [tmp_path / f"{number}.sqlite"] * 4)] == [None] * 4


def test_a_killed_writer_leaves_a_readable_store(path: Path):
    words = [sys.executable, "-c", WRITER, path, "one", "0", "1000000"]
    with (
        subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as writer,
        Store(path) as store,
    ):
        assert writer.stdin is not None
        writer.stdin.write("go\n")
        writer.stdin.flush()
        while not store.keys():
            time.sleep(0.01)
        writer.kill()
        writer.wait()
        records = list(store)
    assert [record["number"] for record in records] == list(range(len(records)))
    assert records


def filled(path: Path) -> None:
    with Store(path) as store:
        for number in range(20):
            store.put(f"key{number}", {"number": number}, {"text": "x" * 3000})


@pytest.mark.parametrize(
    "damage",
    [
        lambda content: b"this is no database" * 100,
        lambda content: content[:100] + os.urandom(4000) + content[4100:],
        lambda content: content[: len(content) // 2],
        lambda content: content[:4096] + bytes(len(content) - 4096),
    ],
    ids=["text", "noise in the first page", "truncated", "zeros"],
)
def test_a_damaged_file_is_noticed_and_left_alone(path: Path, damage):
    filled(path)
    content = damage(path.read_bytes())
    path.write_bytes(content)
    with pytest.raises(DamagedStoreError, match=str(path)):
        Store(path).put("new", {}, {})
    assert path.read_bytes() == content


def test_a_database_of_something_else_is_left_alone(path: Path):
    with sqlite3.connect(path) as connection:
        connection.execute("CREATE TABLE bookmarks (url TEXT)")
    connection.close()
    with pytest.raises(DamagedStoreError, match="a database of something else"):
        Store(path)
    with sqlite3.connect(path) as connection:
        assert connection.execute("SELECT name FROM sqlite_master").fetchall() == [("bookmarks",)]
    connection.close()


def test_a_folder_is_no_store(path: Path):
    path.mkdir()
    with pytest.raises(
        OSError, match=f"{path}: unable to open database file, expected a writable file"
    ):
        Store(path)


RECORDS = [
    {
        "key": "a",
        "seconds": 0.1 + 0.2,
        "work": {"steps": 7},
        "scene": {"stokes": 10.0},
        "runs": [1e-300],
        "note": "ü\n",
    },
    {"key": "b", "seconds": None, "more": 1},
]


def test_export_as_json_lines_loses_nothing(tmp_path: Path):
    export(RECORDS, tmp_path / "out.jsonl")
    lines = (tmp_path / "out.jsonl").read_text(encoding="utf-8").splitlines()
    assert [json.loads(line) for line in lines] == RECORDS


UNENDING = {
    "key": "c",
    "scene": {"stokes": inf},
    "errors": [nan, -inf, 1.0],
    "seconds": inf,
    "note": "none",
}


def refused(word: str) -> None:
    raise AssertionError(f"{word} is no JSON")


def test_exported_json_lines_are_json_and_read_back_as_they_were(tmp_path: Path):
    export([*RECORDS, UNENDING], tmp_path / "out.jsonl")
    lines = (tmp_path / "out.jsonl").read_text(encoding="utf-8").splitlines()
    last = [json.loads(line, parse_constant=refused) for line in lines][-1]
    assert last["scene"] == {"stokes": "Infinity"}
    assert last["errors"] == ["NaN", "-Infinity", 1.0]
    *others, found = read_export(tmp_path / "out.jsonl")
    assert others == RECORDS
    assert isnan(found["errors"].pop(0))
    assert found == {**UNENDING, "errors": [-inf, 1.0]}


@pytest.mark.parametrize(
    ("line", "got"), [("[1, 2]", "got [1, 2], expected a JSON object"), ("{", "expected JSON")]
)
def test_a_line_that_is_no_record_is_named(line: str, got: str, tmp_path: Path):
    path = tmp_path / "mine.jsonl"
    path.write_text(f'{{"stokes": 1}}\n{line}\n', encoding="utf-8")
    with pytest.raises(ValueError, match=re.escape(f"{path}: line 2: ")) as refusal:
        list(read_export(path))
    assert got in str(refusal.value)


def test_exports_of_before_are_read(tmp_path: Path):
    (tmp_path / "old.jsonl").write_text('{"stokes": Infinity}\n{"stokes": 1}\n', encoding="utf-8")
    assert list(read_export(tmp_path / "old.jsonl")) == [{"stokes": inf}, {"stokes": 1}]


def test_compressed_records_read_back_and_are_the_same_bytes_each_time(tmp_path: Path):
    export(RECORDS, tmp_path / "plain.jsonl")
    for name in ("one", "other"):
        (tmp_path / name).mkdir()
        write_records(iter(RECORDS), tmp_path / name)
    content = (tmp_path / "one" / "records.jsonl.gz").read_bytes()
    assert content == (tmp_path / "other" / "records.jsonl.gz").read_bytes()
    assert gzip.decompress(content) == (tmp_path / "plain.jsonl").read_bytes()
    assert list(read_export(tmp_path / "one" / "records.jsonl.gz")) == RECORDS


def test_plain_records_of_before_are_found_until_new_ones_take_their_place(tmp_path: Path):
    export(RECORDS, tmp_path / "records.jsonl")
    export(RECORDS, tmp_path / "spheroid.jsonl")
    assert record_file(tmp_path) == tmp_path / "records.jsonl"
    write_records(RECORDS[:1], tmp_path)
    assert record_files(tmp_path) == {
        "records": tmp_path / "records.jsonl.gz",
        "spheroid": tmp_path / "spheroid.jsonl",
    }
    sums = (tmp_path / "SHA256SUMS").read_text(encoding="utf-8")
    names = [line.split("  ")[1] for line in sums.splitlines()]
    assert names == ["records.jsonl.gz", "spheroid.jsonl"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["SHA256SUMS", *names]


@pytest.mark.parametrize("kept", [2, 30, -4])
def test_damaged_compressed_records_are_named(kept: int, tmp_path: Path):
    export(RECORDS, tmp_path / "whole.jsonl.gz")
    path = tmp_path / "torn.jsonl.gz"
    path.write_bytes((tmp_path / "whole.jsonl.gz").read_bytes()[:kept])
    with pytest.raises(ValueError, match=re.escape(f"{path}: line ")) as refusal:
        list(read_export(path))
    assert "expected gzip" in str(refusal.value)


def test_numbers_without_end_in_csv_are_what_float_reads(tmp_path: Path):
    export([UNENDING], tmp_path / "out.csv")
    with (tmp_path / "out.csv").open(newline="", encoding="utf-8") as file:
        (row,) = csv.DictReader(file)
    assert float(row["seconds"]) == inf
    assert json.loads(row["scene"], parse_constant=refused) == {"stokes": "Infinity"}


def test_export_as_csv(tmp_path: Path):
    export(RECORDS, tmp_path / "out.csv")
    with (tmp_path / "out.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == ["key", "seconds", "work", "scene", "runs", "note", "more"]
    assert float(rows[0]["seconds"]) == 0.1 + 0.2
    assert json.loads(rows[0]["work"]) == {"steps": 7}
    assert rows[0]["note"] == "ü\n"
    assert (rows[1]["seconds"], rows[1]["more"]) == ("", "1")


def test_a_text_that_a_spreadsheet_would_run_is_text(tmp_path: Path):
    export([{"key": "=1+1", "seconds": -1.0}], tmp_path / "out.csv")
    assert (tmp_path / "out.csv").read_text(encoding="utf-8").split() == [
        "key,seconds",
        "'=1+1,-1.0",
    ]


def test_export_refuses_other_endings_and_keeps_the_earlier_file(tmp_path: Path):
    with pytest.raises(
        ValueError, match=r"out\.xlsx: expected a file name ending in \.csv, \.jsonl or \.jsonl\.gz"
    ):
        export(RECORDS, tmp_path / "out.xlsx")
    (tmp_path / "out.jsonl").write_text("earlier", encoding="utf-8")
    with pytest.raises(TypeError):
        export([{"key": object()}], tmp_path / "out.jsonl")
    assert (tmp_path / "out.jsonl").read_text(encoding="utf-8") == "earlier"


def test_a_frame_of_records():
    table = frame(RECORDS)
    assert list(table["key"]) == ["a", "b"]
    assert table.loc[0, "stokes"] == 10.0
    assert table.loc[0, "work.steps"] == 7
    assert table["seconds"].isna().tolist() == [False, True]


def test_records_that_can_be_gone_through_once_are_all_written(tmp_path: Path):
    export(({"a": i} for i in range(3)), tmp_path / "a.csv")
    assert (tmp_path / "a.csv").read_text(encoding="utf-8").split() == ["a", "0", "1", "2"]


def test_a_result_is_made_once_and_comes_as_it_is_stored(path: Path):
    made = []

    def make() -> dict:
        made.append(1)
        return {"pair": (1, 2)}

    with Store(path) as store:
        first = store.made_once("a" * 64, {"case": 1}, make)
        second = store.made_once("a" * 64, {"case": 1}, make)
    assert first == second == {"pair": [1, 2]}
    assert len(made) == 1


def test_a_database_of_something_else_is_not_touched(tmp_path: Path):
    path = tmp_path / "other.sqlite"
    with closing(sqlite3.connect(path)) as other:
        other.execute("CREATE TABLE x (a)")
        other.commit()
    before = path.read_bytes()
    with pytest.raises(DamagedStoreError, match="a database of something else"):
        Store(path)
    assert path.read_bytes() == before


def test_a_mistake_of_the_callers_is_no_damage(tmp_path: Path):
    with Store(tmp_path / "store.sqlite") as store, pytest.raises(sqlite3.ProgrammingError):
        _ = {} in store
