"""Profiles are those of runs with known times."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

from polhode.harness.pages.figures.work_precision import NAMED, TARGETS, profiles, sentence, times
from polhode.solvers.catalogue import SOLVERS


def run(solver: str, tolerance: float, seconds: float, error: float, **more: object) -> dict:
    own = {"scene_name": "one", "stokes": 10.0, "form": "quaternion", "status": "reached_end"}
    own |= {"solver": solver, "tolerance": tolerance}
    return own | {"seconds": seconds, "slow_error": error, "slow_uncertainty": 0.0} | more


RUNS = pd.DataFrame(
    [
        run("taylor", 1e-4, 3.0, 1e-13),
        run("cyrk-vern8", 1e-4, 1.0, 1e-6),
        run("cyrk-vern8", 1e-8, 2.0, 1e-8),
        run("radau", 1e-4, 9.0, 1e-3, status="time_limit"),
        run("radau", 1e-4, 9.0, 1e-12, stokes=20.0, slow_uncertainty=5e-4),
    ]
)


def test_each_problem_has_the_time_to_its_error():
    found = times(RUNS)
    # Eleven errors at the first St; at the second nothing is known below 1e-2.
    assert len(found) == len(TARGETS) + 1
    first = found.xs(0, level=1)
    assert first["taylor"].tolist() == [3.0] * len(TARGETS)
    expected = [1.0] * 5 + [np.sqrt(2.0), 2.0] + [np.nan] * 4
    np.testing.assert_allclose(first["cyrk-vern8"], expected)
    assert found["radau"].dropna().tolist() == [9.0]


def test_the_sentence_and_the_picture_say_the_same():
    found = times(RUNS)
    assert "% of 12 problems that some method solves." in sentence(found)
    assert "cyrk-vern8 is within 2 times the fastest on 58 %" in sentence(found)
    assert "taylor reaches the error most often, on 92 %" in sentence(found)
    figure = profiles(found)
    left, right = figure.axes
    for axes in (left, right):
        shares = {line.get_label(): np.asarray(line.get_ydata())[-1] for line in axes.get_lines()}
        assert shares == pytest.approx({"taylor": 11 / 12, "cyrk-vern8": 7 / 12, "radau": 1 / 12})
    # taylor is the fastest on four of the twelve, and takes three times as long on five.
    taylor = next(line for line in left.get_lines() if line.get_label() == "taylor")
    np.testing.assert_allclose(
        np.asarray(taylor.get_xdata())[:-1], [1] * 4 + [1.5, 3 / np.sqrt(2)] + [3] * 5
    )
    plt.close(figure)


def test_all_that_are_equally_sure_are_named_the_faster_one_first():
    found = pd.DataFrame(
        {"radau": [3.0, 3.0, 3.0], "taylor": [1.0, 1.0, 1.0], "rk45": [9.0, np.nan, np.nan]}
    )
    assert (
        "taylor, radau reach the error most often, on 100 % of them each; on nine in ten of these they are "
        "within 1, 3 times the fastest." in sentence(found)
    )


def test_methods_that_are_neither_fast_nor_sure_are_grey():
    names = [*SOLVERS][: NAMED + 1]
    figure = profiles(pd.DataFrame([{name: 3.0**i for i, name in enumerate(names)}]))
    for axes in figure.axes:
        assert {text.get_text() for text in axes.texts} == set(names[:NAMED])
    plt.close(figure)


def test_what_lies_beyond_the_axis_is_not_counted_at_its_end():
    figure = profiles(
        pd.DataFrame([{"taylor": 1.0, "radau": 5000.0}, {"taylor": 1.0, "radau": 2.0}])
    )
    left, right = figure.axes
    line = next(line for line in left.get_lines() if line.get_label() == "radau")
    assert np.asarray(line.get_xydata()).tolist() == [[2.0, 0.5], [1000.0, 0.5]]
    assert (
        next(line for line in right.get_lines() if line.get_label() == "radau").get_ydata()[-1]
        == 1.0
    )
    plt.close(figure)


def test_long_names_stay_within_the_figure():
    figure = profiles(pd.DataFrame({"averaged-second-order": [1.0, 2.0], "taylor": [3.0, 4.0]}))
    figure.canvas.draw()
    texts = [text for axes in figure.axes for text in axes.texts]
    assert "averaged-\nsecond-order" in {text.get_text() for text in texts}
    for text in texts:
        assert text.get_window_extent().x1 <= figure.bbox.x1, text.get_text()
    plt.close(figure)
