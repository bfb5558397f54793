"""The page of linear flows, quickly measured: tables, sentences, figure."""

from math import inf
from pathlib import Path

import pandas as pd
import pytest

from polhode.harness.common.machine import here
from polhode.harness.flows import measure
from polhode.harness.pages import flows

pytestmark = pytest.mark.usefixtures("quickly_compiled")


def test_a_quick_page_is_made_of_its_tables(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    # As many steps in long double as the looser runs ask for, and the splines through few knots.
    monkeypatch.setattr(measure, "_RUN_STEPS", 60)
    monkeypatch.setattr(measure, "_TRACK_STEPS", 50)
    # Two runs of each form, one of them along a track: Taylor's method is compiled for each tolerance.
    random_scenes = measure.random_scenes
    monkeypatch.setattr(measure, "random_scenes", lambda count: random_scenes(count // 2))
    # One row of each kind that the page tells apart: compiling the others takes most of the time.
    costs = (("spheroid", "spheroid-axis", 10.0, ("cyrk-vern8", "taylor", "splitting")),)
    monkeypatch.setattr(measure, "_COSTS", costs)
    monkeypatch.setattr(measure, "_TRACK_SOLVERS", ("cyrk-vern8", "dop853"))
    flows.write_tables(measure.measure_all(quick=True, quiet=True), here(), tmp_path)
    page = flows.write_page(tmp_path, "polhode flows --quick").read_text(encoding="utf-8")
    assert page == flows.page(tmp_path, "polhode flows --quick")
    assert (tmp_path / "flows.png").stat().st_size > 10_000
    found = flows.read_tables(tmp_path)
    assert found["fields"]["apart"].max() < 1e-14
    assert found["orbits"]["apart"].max() < 1e-10
    assert found["costs"]["solver"].tolist() == ["cyrk-vern8", "taylor", "splitting"]
    assert found["costs"]["apart"].max() < 1e-6
    # Errors fall with the fourth power of the spacing.
    assert found["orders"]["error"].iloc[-2] / found["orders"]["error"].iloc[-1] > 8
    assert found["knots"]["solver"].tolist() == ["cyrk-vern8", "dop853"]
    counts = flows.bounded(found["stated"])
    assert counts["runs"].sum() == 8
    assert len(counts) == 2 * len({*counts["form"]}) == 8
    assert "Of 8 random runs" in page


def test_a_failed_run_is_not_within_the_error_that_it_states():
    failed = dict.fromkeys(("slow", "slow_high", "angle", "angle_high"), inf)
    ended = {"slow": 1e-9, "slow_high": 1e-8, "angle": 1e-9, "angle_high": 1e-8}
    rows = [
        {"form": "quaternion", "track": False, "requested": 1e-6, **run} for run in (failed, ended)
    ]
    counts = flows.bounded(pd.DataFrame(rows)).iloc[0]
    assert (counts["runs"], counts["slow"], counts["angle"]) == (2, 1, 1)


@pytest.mark.parametrize(
    ("alpha", "ratio", "expected"),
    [(0.0, 1.0, 4 * 3.141592653589793), (-1.0, 5.0, 2 * 3.141592653589793)],
)
def test_periods_of_known_motions(alpha: float, ratio: float, expected: float):
    """A sphere in shear turns at half its rate; in rigid rotation every body turns with the fluid."""
    assert measure.period(alpha, ratio) == pytest.approx(expected)
