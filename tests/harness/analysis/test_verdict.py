"""Who wins, on tables whose winner is plain."""

import pandas as pd
import pytest

from polhode.harness.analysis.frames import frame
from polhode.harness.analysis.pareto import TIE, averaged_wins_from, cheapest
from polhode.harness.pages.bench import verdict, when_averaged_wins


def run(solver: str, seconds: float | None, error: float | None, **more: object) -> dict:
    status = "reached_end" if seconds is not None else "time_limit"
    base = {
        "form": "quaternion",
        "solver": solver,
        "tolerance": 1e-6,
        "scene": {"stokes": 100.0},
        "status": status,
    }
    return {**base, "seconds": seconds, "slow_error": error, **more}


def test_the_cheapest_that_is_good_enough():
    runs = frame(
        [
            run("taylor", 3.0, 1e-9),
            run("dop853", 2.0, 1e-5),
            run("radau", 1.0, 1e-2),
            run("lsoda", 4.0, 0.0),
        ]
    )
    assert {
        target: winner[0]["solver"]
        for target in (1, 1e-4, 1e-8, 1e-12)
        if (winner := cheapest(runs, target))
    } == {
        1: "radau",
        1e-4: "dop853",
        1e-8: "taylor",
        1e-12: "lsoda",
    }


def test_an_error_equal_to_the_target_meets_it():
    assert cheapest(frame([run("taylor", 3.0, 1e-6)]), 1e-6) is not None
    assert cheapest(frame([run("taylor", 3.0, 1.1e-6)]), 1e-6) is None


@pytest.mark.parametrize(
    "failure",
    [
        run("dop853", None, None),
        run("dop853", 0.1, 1e-12, status="false_success"),
        run("dop853", 0.1, None),
        run("dop853", 0.1, float("nan")),
        run("dop853", 0.1, float("inf")),
    ],
    ids=["stopped", "lie", "error unknown", "error NaN", "error infinite"],
)
def test_no_failure_wins(failure: dict):
    winner = cheapest(frame([failure, run("taylor", 3.0, 1e-9)]), 1e-6)
    assert winner is not None
    assert winner[0]["solver"] == "taylor"
    assert winner[1] == ()


def test_ties_are_named():
    near, far = 1.0 * TIE * 0.999, 1.0 * TIE * 1.001
    runs = frame(
        [
            run("taylor", 1.0, 1e-9),
            run("taylor", near, 1e-10),
            run("dop853", near, 1e-9),
            run("radau", 1.1, 1e-9, form="averaged"),
            run("dop853", near, 1e-9, form="averaged"),
            run("lsoda", far, 1e-9),
            run("bdf", near, 1e-3),
        ]
    )
    winner = cheapest(runs, 1e-6)
    assert winner is not None
    assert winner[0]["solver"] == "taylor"
    assert winner[0]["seconds"] == 1.0
    assert winner[1] == (("averaged", "radau"), ("quaternion", "dop853"), ("averaged", "dop853"))


def test_another_error_may_be_asked_for():
    runs = frame(
        [
            run("taylor", 1.0, 1e-9, orientation_error=1e-2),
            run("dop853", 2.0, 1e-9, orientation_error=1e-8),
        ]
    )
    winner = cheapest(runs, 1e-6, "orientation_error")
    assert winner is not None
    assert winner[0]["solver"] == "dop853"


def across(averaged_wins: dict[float, bool | None]) -> pd.DataFrame:
    """A full and an averaged run at each St: whether the averaged one is the cheaper; None: neither is good enough."""
    records = []
    for stokes, wins in averaged_wins.items():
        error = 1.0 if wins is None else 1e-4
        scene = {"stokes": stokes}
        records.append(run("taylor", 2.0, error, scene=scene))
        records.append(run("taylor", 1.0 if wins else 3.0, error, scene=scene, form="averaged"))
    return frame(records)


@pytest.mark.parametrize(
    ("pattern", "start"),
    [
        ({1e2: False, 1e3: True, 1e4: True}, 1e3),
        ({1e2: True, 1e3: True}, 1e2),
        ({1e2: True, 1e3: False, 1e4: True}, 1e4),
        ({1e2: True, 1e3: False}, None),
        ({1e2: True, 1e3: None}, None),
        ({1e4: True, 1e2: False, 1e3: True}, 1e3),
    ],
)
def test_from_which_st_on_the_averaged_form_wins(
    pattern: dict[float, bool | None], start: float | None
):
    assert averaged_wins_from(across(pattern), 1e-3) == start


def test_sentences_say_what_the_table_says():
    lines = verdict(across({1e2: False, 1e3: True}), targets=(1e-2, 1e-6))
    assert lines == [
        "For an error of L and E of 0.01 an averaged form is the cheapest at St = 1000, the largest measured.",
        "For an error of L and E of 1e-6 no averaged form is the cheapest at the largest St measured.",
    ]


@pytest.mark.parametrize(
    ("pattern", "words"),
    [
        ({1e2: False, 1e3: True, 1e4: True}, "from St = 1000 on"),
        ({1e3: False, 1e5: True}, "at St = 1e5, not at 1000 (no St between measured)"),
        (
            {1e2: False, 1e4: True, 1e5: True},
            "from St = 10000 on, not at 100 (no St between measured)",
        ),
        ({1e3: True, 1e5: True}, "from St = 1000 on, the smallest measured"),
        ({1e3: True}, "at St = 1000, the only one measured"),
        ({1e3: True, 1e5: False}, None),
    ],
)
def test_nothing_is_claimed_between_st_far_apart(
    pattern: dict[float, bool | None], words: str | None
):
    assert when_averaged_wins(across(pattern), 1e-3) == words


def test_nothing_is_said_of_averaged_forms_that_were_not_run():
    table = across({1e2: False, 1e3: True})
    assert verdict(table.query("form != 'averaged'")) == []


def test_scenes_are_told_of_one_by_one():
    first, second = across({1e2: False, 1e3: True}), across({1e2: True, 1e3: True})
    both = pd.concat([first.assign(scene_name="one"), second.assign(scene_name="two")])
    assert verdict(both, targets=(1e-2,)) == [
        "one: For an error of L and E of 0.01 an averaged form is the cheapest at St = 1000, the largest measured.",
        "two: For an error of L and E of 0.01 an averaged form is the cheapest from St = 100 on, the "
        "smallest measured.",
    ]


def test_a_lead_within_the_spread_of_the_two_runs_is_a_tie():
    runs = frame(
        [
            run("taylor", 1.0, 1e-9, seconds_spread=0.4),
            run("dop853", 1.39, 1e-9, seconds_spread=0.01),
            run("radau", 1.41, 1e-9, seconds_spread=0.01),
            run("lsoda", 1.6, 1e-9, seconds_spread=0.7),
        ]
    )
    winner = cheapest(runs, 1e-6)
    assert winner is not None
    assert winner[0]["solver"] == "taylor"
    assert [method.solver for method in winner[1]] == ["dop853", "lsoda"]
