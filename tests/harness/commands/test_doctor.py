"""`polhode doctor`: true about what is there, clear about what is not."""

import json
from pathlib import Path

import pytest
from commandline import Run

from polhode.harness.commands import setup
from polhode.harness.commands.setup import examine, look, steady
from polhode.solvers.catalogue import SOLVERS


@pytest.fixture(autouse=True)
def no_watch(monkeypatch: pytest.MonkeyPatch):
    """One look at the clock instead of a second of them."""
    watch = setup.watch_sentinel
    monkeypatch.setattr(setup, "watch_sentinel", lambda seconds: watch(0.0))


@pytest.fixture
def no_cold_start(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(setup, "cold_start", dict)


def test_json_tells_versions_solvers_and_caches(here: Run, environment: dict[str, str]):
    done = here("doctor", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    found = json.loads(done.stdout)
    assert [row["name"] for row in found["adapters"]] == list(SOLVERS)
    assert found["versions"]["polhode"]
    place = Path(environment["POLHODE_CACHE"])
    assert [cache["folder"] for cache in found["caches"]] == [
        str(place / "references"),
        str(place / "heyoka"),
    ]
    assert found["steadiness"]["ratio"] >= 1
    pieces = {"import", "compilation", "integration", "output"}
    assert set(found["cold_start"]) == pieces | {"in all"}
    assert all(seconds > 0 for seconds in found["cold_start"].values())


@pytest.mark.usefixtures("no_cold_start")
def test_page_is_plain_where_it_is_no_terminal(here: Run):
    done = here("doctor")
    assert done.returncode == 0
    assert "\x1b" not in done.stdout
    assert all(name in done.stdout for name in SOLVERS)


@pytest.mark.usefixtures("no_cold_start")
def test_what_is_missing_is_named_with_its_remedy(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("polhode.solvers.contract.installed", lambda library: library != "CyRK")
    found = examine()
    missing = [row["name"] for row in found["adapters"] if not row["available"]]
    assert missing == [name for name in SOLVERS if name.startswith("cyrk-")]
    assert "cyrk-vern8: cyrk is not installed: pip install cyrk" in found["advice"]


def test_a_cache_is_counted(tmp_path: Path):
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep" / "one").write_bytes(b"12345")
    (tmp_path / "two").write_bytes(b"123")
    found = {"name": "files", "folder": tmp_path, "files": 2, "size": 8, "writable": True}
    assert look("files", tmp_path) == found
    absent = tmp_path / "not" / "yet"
    assert look("files", absent) == {**found, "folder": absent, "files": 0, "size": 0}


def test_a_place_that_is_no_folder_is_no_cache(tmp_path: Path):
    (tmp_path / "file").write_text("")
    assert not look("files", tmp_path / "file" / "cache")["writable"]


@pytest.mark.parametrize(
    ("ratio", "load", "expected"),
    [(1.0, 0.0, True), (1.02, None, True), (1.2, 0.0, False), (1.0, 2.0, False)],
)
def test_steadiness(ratio: float, load: float | None, expected: bool):
    assert steady({"seconds": 1e-3, "ratio": ratio, "load": load}) is expected


@pytest.mark.usefixtures("no_cold_start")
def test_advice_on_an_unsteady_machine(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(
        setup, "watch_sentinel", lambda _: {"seconds": 1e-3, "ratio": 1.5, "load": None}
    )
    assert any("noisy" in line for line in examine()["advice"])
