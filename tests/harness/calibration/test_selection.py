"""`pick` in the language of algorithm selection: penalties, the single best way, the gap closed, ASlib's tables."""

from dataclasses import replace
from math import inf
from typing import Any

import pandas as pd
import pytest

from polhode.harness.calibration.scenes import questions
from polhode.harness.calibration.selection import (
    COLUMNS,
    CUTOFF,
    PENALTY,
    PICK,
    decade,
    pays_from,
    penalised,
    rules,
    runs_of,
    scores,
)
from polhode.models.scenes import named_scene

# Two scenes: times of two ways, one of which fails once, and those of `pick`.
WAYS = pd.DataFrame(
    [
        ("s", "short", "quaternion/taylor/-1", 2.0, True),
        ("s", "short", "quaternion/radau/+0", 1.0, True),
        ("s", "short", PICK, 1.5, True),
        ("l", "long", "quaternion/taylor/-1", 30.0, True),
        ("l", "long", "quaternion/radau/+0", 5.0, False),
        ("l", "long", PICK, 10.0, True),
    ],
    columns=list(COLUMNS),
)


def test_what_misses_the_error_or_takes_too_long_is_penalised():
    table: Any = penalised(WAYS)
    assert table["quaternion/radau/+0"].to_dict() == {"s": 1.0, "l": PENALTY * CUTOFF}
    assert table["quaternion/taylor/-1"].to_dict() == {"s": 2.0, "l": 3.0}
    slow = WAYS.assign(seconds=WAYS["seconds"].where(WAYS["seconds"] != 30.0, 10.0 * CUTOFF + 1))
    assert penalised(slow)["quaternion/taylor/-1"]["l"] == PENALTY * CUTOFF


def test_the_gap_is_that_between_the_single_best_and_the_virtual_best():
    both: Any = scores(WAYS).query("stratum == 'both'").set_index("way")
    assert both["par10"][PICK] == pytest.approx(1.25)
    assert both["gap_closed"][PICK] == pytest.approx((2.5 - 1.25) / (2.5 - 1))
    assert both["gap_closed"]["single best: quaternion/taylor/-1"] == 0
    assert both["within"][PICK] == 1


def test_scenes_that_no_way_solves_have_no_scores():
    missed = WAYS.assign(met=WAYS["met"] & (WAYS["stratum"] == "short"))
    assert set(scores(missed)["stratum"]) == {"both", "short"}


def test_pick_pays_from_the_run_that_its_own_cost_is_saved_on():
    scenes = pd.DataFrame({"scene": ["s", "l"], "seconds": [1.5, 10.0], "pick_seconds": [1.0, 1.0]})
    assert pays_from(scenes, WAYS) == 30.0
    assert pays_from(scenes.assign(pick_seconds=100.0), WAYS) == inf


def test_ways_are_named_by_powers_of_ten_from_the_error():
    question = replace(questions(1, 1)[0], scene=named_scene("paper"), error=3e-7, want="slow")
    assert decade(question) == -7
    record = {"form": "quaternion", "status": "reached_end", "seconds": 2.0, "slow_error": 1e-7}
    records = [
        {**record, "solver": "taylor", "tolerance": 1e-8},
        {**record, "solver": "taylor", "tolerance": 3e-8},
    ]
    found = {row["algorithm"]: row for row in runs_of(question, "short", records, records[1])}
    assert (found["quaternion/taylor/-1"]["seconds"], found["quaternion/taylor/-1"]["met"]) == (
        2.0,
        True,
    )
    rule = "taylor at a tenth of the error"
    assert found[rule] == {**found["quaternion/taylor/-1"], "algorithm": rule}
    assert found["LSODA at a hundredth of the error"]["met"] is False
    assert not any("/" in name for name in rules(question).values())
    assert found[PICK]["met"] is True
    assert "quaternion/cyrk-vern7/+0" in rules(question)
