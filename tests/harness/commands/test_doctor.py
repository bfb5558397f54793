"""`polhode doctor`: true about what is there, clear about what is not."""

import json
import platform
import tomllib
from pathlib import Path

import pytest
from commandline import Run
from packaging.requirements import Requirement

from polhode.harness.commands import setup
from polhode.harness.commands.setup import examine, look, steady
from polhode.harness.common import wheels
from polhode.solvers.catalogue import SOLVERS

ROOT = Path(__file__).parents[3]
# Systems and processors that polhode is installed on, and what has no wheel there.
EVERYWHERE = {
    ("Linux", "x86_64"): set(),
    ("Linux", "aarch64"): {"cyrk", "scikit-sundae"},
    ("Darwin", "arm64"): {"heyoka"},
    ("Darwin", "x86_64"): {"cyrk", "heyoka"},
    ("Windows", "AMD64"): {"heyoka"},
}


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


@pytest.mark.usefixtures("no_cold_start")
@pytest.mark.parametrize("place", EVERYWHERE)
def test_what_has_no_wheel_here_is_said(
    place: tuple[str, str], monkeypatch: pytest.MonkeyPatch, here: Run
):
    system, machine = place
    libraries = {"CyRK": "cyrk", "heyoka": "heyoka", "sksundae": "scikit-sundae"}
    monkeypatch.setattr(
        "polhode.solvers.contract.installed", lambda library: library not in libraries
    )
    monkeypatch.setattr(platform, "system", lambda: system)
    monkeypatch.setattr(platform, "machine", lambda: machine)
    rows = {row["name"]: row["why_not"] for row in json.loads(here("solvers", "--json").stdout)}
    advice = examine()["advice"]
    for name, package in (("cyrk-vern8", "cyrk"), ("taylor", "heyoka"), ("ida", "scikit-sundae")):
        line = f"{package} is not installed: pip install {package}"
        if package in EVERYWHERE[place]:
            line += f" (no wheel for {system} {machine}: pip compiles it)"
        assert rows[name] == line
        assert f"{name}: {line}" in advice


def test_what_is_required_somewhere_has_a_wheel_there():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    systems = {"Linux": "linux", "Darwin": "darwin", "Windows": "win32"}
    required: dict[str, set[tuple[str, str]]] = {name: set() for name in wheels.PLATFORMS}
    for requirement in map(Requirement, project["dependencies"]):
        marker = requirement.marker
        if marker is None:
            continue
        for system, machine in EVERYWHERE:
            place = {"sys_platform": systems[system], "platform_machine": machine}
            if marker.evaluate(place):
                required[requirement.name].add((system, machine))
    assert required == {name: set(places) for name, places in wheels.PLATFORMS.items()}


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
