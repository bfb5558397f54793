"""The regime map, on records with known winners."""

import re
from dataclasses import replace
from math import isnan, nan

import numpy as np
import pandas as pd
import pytest
from commandline import runner
from matplotlib.legend import Legend

from polhode.harness.analysis.in_full import planned_in_full, ran_in_full
from polhode.harness.analysis.pareto import Method, cost, front
from polhode.harness.analysis.regime_map import LONGEST_SLOW_TIME, cells, standings
from polhode.harness.commands.bench import ahead, regimes
from polhode.harness.common.store import Store
from polhode.harness.pages.figures.map_picture import CODES, draw, picture
from polhode.harness.pages.figures.style import LOOKS, colour
from polhode.harness.pages.regimes import read_cells, rewrite_page, sentence, write_page
from polhode.harness.studies.study import read_study
from polhode.models.catalogue import form as find_form

TOLERANCES = [10.0**-k for k in range(2, 13)]
SURROUNDINGS = {
    "machine": {"processor": "x", "cores": 2, "system": "y", "python": "3"},
    "versions": {"numpy": "2"},
}


def runs(
    form: str, solver: str, stokes: float, seconds: float, slope: float, floor: float = 0.0
) -> list[dict]:
    """Records of a method whose time is seconds · error^(-slope), down to a floor of its error."""
    return [
        {
            "scene_name": "ellipsoid",
            "stokes": stokes,
            "form": form,
            "solver": solver,
            "tolerance": tolerance,
            "status": "reached_end",
            "seconds": seconds * tolerance**-slope,
            "slow_error": max(tolerance, floor),
            "orientation_error": nan if floor else tolerance,
            "slow_uncertainty": 1e-14,
            "orientation_uncertainty": 1e-11,
            "sentinel_seconds": 1e-3,
        }
        for tolerance in TOLERANCES
    ]


@pytest.fixture
def table() -> pd.DataFrame:
    stiff = runs("quaternion", "cyrk-radau", 1e-3, 1e-4, 0.2) + runs(
        "quaternion", "taylor", 1e-3, 1e-1, 0.0
    )
    middle = runs("quaternion", "cyrk-radau", 1e3, 1e-1, 0.2) + runs(
        "quaternion", "taylor", 1e3, 1e-3, 0.02
    )
    middle += runs("quaternion", "cyrk-vern8", 1e3, 1.1e-3, 0.02)
    large = runs("averaged", "taylor", 1e6, 1e-4, 0.0, floor=1e-5) + runs(
        "averaged", "ida", 1e6, 1e-2, 0.0, floor=1e-5
    )
    large += runs("quaternion", "taylor", 1e6, 1.0, 0.02)
    return pd.DataFrame(stiff + middle + large)


def test_cost_is_interpolated_along_the_power_law():
    points = front(pd.DataFrame(runs("quaternion", "taylor", 1.0, 2.0, 0.25)), "slow_error")
    assert cost(points, 3e-6) == pytest.approx(2.0 * 3e-6**-0.25, rel=1e-12)
    assert cost(points, 1.0) == pytest.approx(2.0 * 1e-2**-0.25)
    assert isnan(cost(points, 1e-13))
    assert isnan(cost(np.empty((0, 2)), 1e-3))


def test_runs_that_another_one_beats_do_not_count():
    spoilt = runs("quaternion", "taylor", 1.0, 2.0, 0.25)
    spoilt.append({**spoilt[3], "seconds": 1e3, "slow_error": 2e-4})
    spoilt.append({**spoilt[3], "seconds": 1e-9, "slow_error": 1e-9, "status": "time_limit"})
    points = front(pd.DataFrame(spoilt), "slow_error")
    assert len(points) == len(TOLERANCES)
    assert points[:, 1].tolist() == sorted(points[:, 1].tolist())


def test_winners_leads_and_ties(table: pd.DataFrame):
    found = {(cell.stokes, cell.target): cell for cell in cells(table, "slow_error")}
    stiff, middle, large = (found[stokes, 1e-4] for stokes in (1e-3, 1e3, 1e6))
    assert stiff.winner == Method("quaternion", "cyrk-radau")
    assert stiff.lead == pytest.approx(1e-1 / (1e-4 * 1e-4**-0.2))
    assert not stiff.tied
    assert (middle.winner, middle.second) == (
        Method("quaternion", "taylor"),
        Method("quaternion", "cyrk-vern8"),
    )
    assert middle.tied
    assert middle.lead == pytest.approx(1.1)
    assert large.winner == Method("averaged", "taylor")
    # Another solver of the same averaged form is not another way: the lead is that over the full
    # equations.
    assert large.second == Method("quaternion", "taylor")
    assert found[1e6, 1e-6].winner == Method("quaternion", "taylor")
    sides = [cell.winner.side for cell in (stiff, middle, large) if cell.winner]
    assert sides == ["implicit", "explicit", "averaged"]


@pytest.mark.parametrize(
    ("form", "solver", "side", "label"),
    [
        ("hybrid", "cyrk-dop853", "tailored", "hybrid"),
        ("spheroid-axis", "splitting", "tailored", "splitting"),
        ("spheroid-axis", "splitting-extended", "tailored", "splitting-extended"),
        ("spheroid-axis", "stroboscopic", "tailored", "stroboscopic"),
        ("spheroid-axis", "taylor", "explicit", "taylor"),
        ("quaternion", "cyrk-bdf", "implicit", "cyrk-bdf"),
        ("euler-top", "exact", "explicit", "exact"),
        ("averaged-second-order", "cyrk-dop853", "averaged", "averaged-second-order"),
    ],
)
def test_methods_made_for_large_stokes_numbers_have_a_band_of_their_own(form, solver, side, label):
    method = Method(form, solver)
    assert (method.side, method.label) == (side, label)


def test_a_hybrid_run_that_averaged_nothing_is_one_of_the_full_form():
    """Its errors and its work are those of a full run at another tolerance, or its plan says so."""
    full = [
        {**run, "work.steps": 10 * place}
        for place, run in enumerate(runs("quaternion", "taylor", 1e4, 1.0, 0.1))
    ]
    hybrid = [{**run, "form": "hybrid", "tolerance": 10 * run["tolerance"]} for run in full[:4]]
    # The same error after other steps: a run with averaged segments.
    hybrid[3]["work.steps"] = 7
    failed = {**hybrid[0], "slow_error": None, "status": "time_limit"}
    table = pd.DataFrame([*full, *hybrid, failed])
    assert ran_in_full(table).tolist() == [False] * len(full) + [True] * 3 + [False] * 2
    study = read_study(None, "regimes")
    by_plan = ran_in_full(
        table, [(name, scene) for name, scene in study.scenes if scene.stokes == 1e4]
    )
    assert by_plan.tolist()[: len(full) + 3] == ran_in_full(table).tolist()[: len(full) + 3]
    short = study.scenes[0][1]
    assert planned_in_full(replace(short, stokes=1e2, time=50.0), 1e-6)
    assert not planned_in_full(replace(short, stokes=1e7, time=5e6), 1e-4)


def test_a_page_is_written_from_its_records_and_anew_from_its_runs(tmp_path, table: pd.DataFrame):
    study = read_study(None, "regimes")
    study = replace(study, scenes=tuple(pair for pair in study.scenes if pair[0] == "ellipsoid"))
    records = [
        {**record, **SURROUNDINGS, "date": "2026-01-01T00:00:00Z"}
        for record in table.to_dict("records")
    ]
    page = write_page(study, records, tmp_path, "polhode regimes --quick")
    before = page.read_text(encoding="utf-8")
    assert "- The ellipsoid, slow variables: implicit solvers win" in before
    assert "averaged forms win 4 cells" in before
    assert re.search(r"\| quaternion +\| cyrk-vern8 +\| +0 / 0 \|", before)
    assert {path.name for path in tmp_path.iterdir()} == {
        "README.md",
        "SHA256SUMS",
        "ellipsoid.png",
        "ellipsoid-orientation.png",
        "profiles.png",
        "profiles-long.png",
        "cells.csv",
        "runs.csv",
    }
    maps = read_cells(tmp_path / "cells.csv")
    assert str(maps["ellipsoid", "slow_error"]) == str(cells(table, "slow_error"))
    cells_before = (tmp_path / "cells.csv").read_text()
    page.write_text(before.replace("How to read it", "Gone"))
    assert rewrite_page(study, tmp_path).read_text() == before
    assert len((tmp_path / "cells.csv").read_text()) == pytest.approx(len(cells_before), rel=0.05)
    with pytest.raises(ValueError, match="no such file, expected a page"):
        rewrite_page(study, tmp_path / "nowhere")


def test_a_lead_on_the_map_within_the_spread_of_the_runs_is_a_tie(table: pd.DataFrame):
    """Of the run that meets the error, of either method."""
    noisy = table.assign(seconds_spread=0.0)
    large = (noisy["stokes"] == 1e-3) & (noisy["solver"] == "taylor")
    noisy.loc[large, "seconds_spread"] = 2e3 * noisy.loc[large, "seconds"]
    before, after = (
        {(cell.stokes, cell.target): cell for cell in cells(runs_table, "slow_error")}
        for runs_table in (table, noisy)
    )
    assert not before[1e-3, 1e-4].tied
    assert after[1e-3, 1e-4].tied
    assert after[1e-3, 1e-4].spread == pytest.approx(2e3)
    assert not after[1e6, 1e-4].tied


def test_nobody_wins_where_the_reference_cannot_tell(table: pd.DataFrame):
    found = {(cell.stokes, cell.target): cell for cell in cells(table, "orientation_error")}
    assert found[1e3, 1e-9].winner is not None
    assert found[1e3, 1e-11].winner is None
    assert not found[1e3, 1e-11].resolved
    assert found[1e6, 1e-2].winner == Method("quaternion", "taylor")


def test_the_sentence_names_each_side(table: pd.DataFrame):
    words = sentence(cells(table, "slow_error"), "slow")
    lead = r"\(by [\d.e]+ × in the median, 0 ties\)"
    assert re.search(
        rf"^slow: implicit solvers win \d+ cells at St = 0.001 {lead}; explicit", words
    )
    assert "from St = 1000 to 1e6" in words
    assert "averaged forms win 4 cells at St = 1e6" in words
    assert "Cells by form: quaternion 29." in words
    assert "implicit solvers never win; explicit" in sentence([], "slow")
    tied = next(cell for cell in cells(table, "slow_error") if cell.tied)
    assert "explicit solvers win 1 cell at St = 1000 (by 1.1 × in the median, 1 tie)" in sentence(
        [tied], "slow"
    )


def test_every_cell_is_drawn_in_its_winners_colour(table: pd.DataFrame):
    import matplotlib.pyplot as plt
    from matplotlib.colors import to_hex
    from matplotlib.patches import Rectangle

    figure, axes = plt.subplots()
    found = cells(table, "slow_error")
    draw(axes, found)
    boxes = [patch for patch in axes.patches if isinstance(patch, Rectangle)]
    expected = [colour(cell.winner.label).lower() if cell.winner else None for cell in found]
    assert [to_hex(box.get_facecolor()) for box in boxes] == expected
    plt.close(figure)


def test_colours_are_known_for_every_method_of_the_study():
    study = read_study(None, "regimes")
    labels = {Method(form, solver).label for form in study.forms for solver in study.solvers}
    assert labels <= set(LOOKS)


def test_the_study_covers_the_range_within_the_horizon():
    study = read_study(None, "regimes")
    numbers = sorted({scene.stokes for _, scene in study.scenes})
    assert (numbers[0], numbers[-1]) == (1e-4, 1e8)
    assert np.allclose(np.diff(np.log10(numbers)), 1)
    assert all(
        scene.slow_time == pytest.approx(0.5) for _, scene in study.scenes if scene.stokes >= 100
    )


def test_averaged_forms_are_left_out_where_slow_time_is_endless():
    study = replace(read_study(None, "regimes"), longest_slow_time=LONGEST_SLOW_TIME)
    cases = [case for batch in study.batches() for case in batch]
    averaged = {case.scene.stokes for case in cases if find_form(case.form).averaged}
    assert averaged == {case.scene.stokes for case in cases if case.scene.stokes >= 1}


def test_every_method_stands_somewhere_whether_it_wins_or_not(table: pd.DataFrame):
    lost = {
        **runs("quaternion", "ida", 1e3, 1.0, 0.0)[0],
        "status": "time_limit",
        "seconds": nan,
        "slow_error": nan,
    }
    beaten = runs("quaternion", "lsoda", 1e3, 5.0, 0.02)
    table = pd.concat([table, pd.DataFrame([lost, *beaten])])
    found = cells(table, "slow_error")
    rows = {str(row.method): row for row in standings(table, "slow_error", found)}
    assert set(rows) == {
        f"{form}, {solver}" for form, solver in zip(table["form"], table["solver"], strict=True)
    }
    assert sum(row.won for row in rows.values()) == sum(cell.winner is not None for cell in found)
    taylor = rows["quaternion, taylor"]
    assert (taylor.won, taylor.tied) == (18, 0)
    assert (taylor.front, taylor.measured, taylor.failures) == (2, 3, {})
    assert rows["quaternion, cyrk-vern8"].tied == len(TOLERANCES)
    assert rows["quaternion, cyrk-vern8"].front == 0
    assert (rows["quaternion, lsoda"].front, rows["quaternion, lsoda"].won) == (0, 0)
    assert rows["quaternion, ida"].failures == {"time_limit": 1}


def test_methods_without_a_colour_of_their_own_and_any_st_are_drawn():
    import matplotlib.pyplot as plt

    table = pd.DataFrame(
        runs("quaternion", "lsoda", 50.0, 1.0, 0.1) + runs("quaternion", "lsoda", 0.0, 1.0, 0.1)
    )
    drawing = picture(cells(table, "slow_error"), {0.0: 20.0, 50.0: 25.0}, "Slow", "Measured here.")
    below = [text.get_text() for text in drawing.axes[0].texts if text.get_position()[1] < 0]
    assert below == ["St", "0", "50", "over", "$t$=20", "$t$=25"]
    assert "Measured here." in drawing.texts[-1].get_text()
    plt.close(drawing)


def test_the_key_of_the_map_lies_on_top_and_within_the_picture(table: pd.DataFrame):
    import matplotlib.pyplot as plt

    times = dict.fromkeys(table["stokes"], 20.0)
    drawing = picture(cells(table, "slow_error"), times, "Slow variables")
    drawing.canvas.draw()
    keys = [artist for artist in drawing.get_children() if isinstance(artist, Legend)]
    assert {text.get_text() for key in keys for text in key.get_texts()} >= {
        "T  taylor",
        "V8  cyrk-vern8",
        "R  cyrk-radau",
        "A1  first order",
        "implicit methods",
    }
    (axes,) = drawing.axes
    for key in keys:
        box = key.get_window_extent()
        assert drawing.bbox.x0 <= box.x0 <= box.x1 <= drawing.bbox.x1
        assert axes.get_window_extent().y1 < box.y0
        assert box.y1 <= drawing.bbox.y1 + 1
    plt.close(drawing)


def test_the_letters_of_the_winner_stand_in_a_cell():
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots()
    draw(axes, cells(pd.DataFrame(runs("quaternion", "taylor", 1.0, 0.9998e-3, 0.0)), "slow_error"))
    assert {text.get_text() for text in axes.texts} == {CODES["taylor"]}
    plt.close(figure)


STUDY = """
name = "few"
title = "Few"
tolerances = [1e-4]
forms = ["spheroid-axis"]
solvers = ["taylor"]

[[scenes]]
name = "spheroid"
stokes = [1.0, 10.0]
time = 1.0
shape.semi_axes = [1.0, 1.0, 2.0]
start.euler_angles = [1.0, 0.5, 0.0]
start.euler_rates = [1.0, 1.0, 1.0]
"""


def test_resume_tells_how_much_is_ahead_and_shows_no_cases_of_an_older_study(tmp_path):
    file, out = tmp_path / "few.toml", tmp_path / "out"
    file.write_text(STUDY, encoding="utf-8")
    study = read_study(file)
    result = {
        "seconds": 1e-3,
        "slow_error": 1e-5,
        "orientation_error": 1e-5,
        "status": "reached_end",
    }
    result |= {
        "slow_uncertainty": 1e-14,
        "orientation_uncertainty": 1e-12,
        "sentinel_seconds": 1e-3,
        **SURROUNDINGS,
    }
    with Store(out / "store.sqlite") as store:
        assert "holds 0 of 2 cases, 2 are measured now" in ahead(study, store)
        for case in (case for batch in study.batches() for case in batch):
            store.put(case.key, case.content, result)
    file.write_text(STUDY.replace("[1.0, 10.0]", "[1.0]"), encoding="utf-8")
    done = runner().invoke(regimes, [str(file), "--out", str(out), "--resume"])
    assert done.exit_code == 0
    assert "holds 1 of 1 cases, 0 are measured now" in done.stderr
    assert pd.read_csv(out / "runs.csv")["stokes"].tolist() == [1.0]
    assert set(pd.read_csv(out / "cells.csv")["St"]) == {1.0}
    assert not re.search(
        r"^\| +10 \|", (out / "README.md").read_text(encoding="utf-8"), re.MULTILINE
    )
