"""Figures: what is drawn is what the records say."""

from itertools import pairwise
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest

from polhode.harness.analysis.frames import frame
from polhode.harness.analysis.pareto import pareto_front
from polhode.harness.pages.figures.style import GREY, INK, SOFT, colour, power
from polhode.harness.pages.figures.work_precision import (
    BEHIND,
    UNKNOWN_LABEL,
    conditions,
    save,
    work_precision,
    work_precision_panels,
)
from polhode.solvers.catalogue import SOLVERS

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.colors import to_hex
from matplotlib.text import Text


def run(
    solver: str, tolerance: float, seconds: float | None, error: float | None, **more: object
) -> dict:
    return {
        "form": "quaternion",
        "solver": solver,
        "tolerance": tolerance,
        "scene": {"stokes": 100.0},
        "status": "reached_end" if seconds is not None else "time_limit",
        "seconds": seconds,
        "slow_error": error,
        "orientation_error": None if error is None else 10 * error,
        "slow_uncertainty": 1e-12,
        "orientation_uncertainty": 1e-11,
        "model_slow_error": 0.0,
        "model_orientation_error": None,
        **more,
    }


RECORDS = [
    run("taylor", 1e-4, 0.1, 1e-4),
    run("taylor", 1e-8, 0.2, 1e-8),
    run("cyrk-radau", 1e-4, 0.3, 1e-3),
    run("cyrk-radau", 1e-8, None, None),
    run("cyrk-dop853", 1e-4, 0.05, 1e-2),
    run("taylor", 1e-4, 0.01, 2e-2, form="averaged", model_slow_error=1.9e-2),
    run("taylor", 1e-8, 0.02, 1.9e-2, form="averaged", model_slow_error=1.9e-2),
]


@pytest.fixture
def axes():
    figure, axes = plt.subplots()
    yield axes
    plt.close(figure)


def test_every_run_is_drawn_where_its_error_and_time_say(axes):
    assert work_precision(axes, frame(RECORDS)) is axes
    drawn = {
        line.get_label(): np.column_stack([*line.get_data()]).tolist() for line in axes.get_lines()
    }
    assert drawn["taylor"] == [[1e-4, 0.1], [1e-8, 0.2]]
    assert drawn["cyrk-radau"] == [[1e-3, 0.3]]
    assert drawn["cyrk-dop853"] == [[1e-2, 0.05]]
    assert drawn["averaged form,\ncheapest runs"] == [[2e-2, 0.01], [1.9e-2, 0.02]]
    assert drawn["averaged form,\nmodel error"] == [[1.9e-2, 0], [1.9e-2, 1]]
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")


def test_pareto_front():
    points = [
        (1.0, 1e-2),
        (2.0, 1e-4),
        (3.0, 1e-3),
        (4.0, 1e-8),
        (4.0, 1e-9),
        (5.0, 1e-9),
        (0.5, 1.0),
    ]
    runs = pd.DataFrame(points, columns=["seconds", "slow_error"])
    front = pareto_front(runs)
    assert list(front["seconds"]) == [0.5, 1.0, 2.0, 4.0]
    assert list(front["slow_error"]) == [1.0, 1e-2, 1e-4, 1e-9]


def test_a_run_counts_on_the_front_if_it_halves_the_error():
    """Else rounding lets a run of 0.77 s lead beside one of 76 µs."""
    runs = pd.DataFrame(
        {"slow_error": [1e-6, 1.64e-13, 1.4e-13, 0.8e-13], "seconds": [1e-5, 76e-6, 0.77, 1.0]}
    )
    assert pareto_front(runs)["seconds"].tolist() == [1e-5, 76e-6, 0.77, 1.0]
    assert pareto_front(runs, gain=2.0)["seconds"].tolist() == [1e-5, 76e-6, 1.0]


def test_pareto_front_against_brute_force():
    generator = np.random.default_rng(5)
    runs = pd.DataFrame({"seconds": generator.random(60), "slow_error": generator.random(60)})
    better = [
        not any(
            (o.seconds < r.seconds) and (o.slow_error < r.slow_error) for o in runs.itertuples()
        )
        for r in runs.itertuples()
    ]
    assert set(pareto_front(runs).index) == set(runs.index[better])


def test_points_that_the_reference_cannot_tell_are_grey_and_the_legend_says_so():
    near = {"slow_uncertainty": 2e-9}
    records = [run("taylor", 1e-4, 0.1, 2.1e-8, **near), run("taylor", 1e-8, 0.2, 2e-8, **near)]
    records += [
        run("taylor", 1e-8, 0.02, 1e-8, form="averaged", **near),
        run("ida", 1e-4, 1.0, 1e-4, **near),
    ]
    figure = work_precision_panels(frame(records), "slow_error", "error of L and E")
    (panel,) = figure.axes
    lines = {line.get_label(): line for line in panel.get_lines()}
    grey = [line for line in panel.get_lines() if line.get_color() == GREY]
    assert [np.column_stack([*line.get_data()]).tolist() for line in grey] == [
        [[2e-8, 0.2]],
        [[1e-8, 0.02]],
    ]
    assert UNKNOWN_LABEL in lines
    assert all(line.get_zorder() > lines["taylor"].get_zorder() for line in grey)
    assert [text.get_text() for text in figure.legends[0].get_texts()].count(
        UNKNOWN_LABEL.replace("\n", " ")
    ) == 1
    assert lines["Pareto front"].get_data()[0].tolist() == [2.1e-8], "an unknown error wins nothing"
    plt.close(figure)


def test_the_legend_lies_within_the_picture():
    second = [
        {**each, "form": "averaged-second-order", "solver": "cyrk-vern8"} for each in RECORDS[-2:]
    ]
    numbers = [
        {**record, "scene": {"stokes": stokes}}
        for stokes in (1e2, 1e3)
        for record in [*RECORDS, *second]
    ]
    for records in (numbers, numbers[: len(numbers) // 2]):
        figure = work_precision_panels(frame(records), "slow_error", "error of L and E")
        figure.canvas.draw()
        (legend,) = figure.legends
        box, page = legend.get_window_extent(), figure.bbox
        assert page.x0 <= box.x0 <= box.x1 <= page.x1
        assert page.y0 <= box.y0
        plt.close(figure)


def test_the_pareto_front_of_the_full_forms_is_drawn_beneath_all(axes):
    lines = {line.get_label(): line for line in work_precision(axes, frame(RECORDS)).get_lines()}
    front = lines.pop("Pareto front")
    # Stairs: up to a run's error it costs as much as that run.
    corners = [[1e-2, 0.05], [1e-2, 0.1], [1e-4, 0.1], [1e-4, 0.2], [1e-8, 0.2]]
    assert np.column_stack([*front.get_data()]).tolist() == corners
    assert all(front.get_zorder() < line.get_zorder() for line in lines.values())


def test_forms_of_one_solver_are_told_apart(axes):
    records = [
        *RECORDS[:2],
        *(run("taylor", 1e-4, 0.3, 1e-4, form=form) for form in ("euler-angles", "averaged")),
    ]
    lines = {line.get_label(): line for line in work_precision(axes, frame(records)).get_lines()}
    first, second = lines["taylor, quaternion"], lines["taylor, euler-angles"]
    assert first.get_color() == second.get_color()
    assert first.get_linestyle() != second.get_linestyle()


def test_runs_without_a_result_stand_hollow_at_their_tolerance_above_the_panel(axes):
    records = [*RECORDS, run("ida", 1e-8, None, None, status="non_finite")]
    work_precision(axes, frame(records))
    hollow = {line.get_label(): line for line in axes.get_lines() if line.get_fillstyle() == "none"}
    assert {label: list(line.get_xdata()) for label, line in hollow.items()} == {
        "_cyrk-radau: no result": [1e-8],
        "_ida: no result": [1e-8],
    }
    top = axes.get_window_extent().y1
    places = [line.get_transform().transform(line.get_xydata())[0] for line in hollow.values()]
    assert all(y > top for _, y in places)
    assert len({x for x, _ in places}) == 2, "side by side"


def test_methods_off_the_front_are_pale(axes):
    lines = {line.get_label(): line for line in work_precision(axes, frame(RECORDS)).get_lines()}
    assert lines["cyrk-radau"].get_alpha() is not None
    assert lines["taylor"].get_alpha() is None


def test_every_line_of_the_front_is_named_beside_its_panel_and_no_two_names_meet(
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.syspath_prepend(Path(__file__).parents[3] / "docs" / "examples")
    long = "own_solver:ClassicalRungeKutta"
    front = [
        run(name, 1e-4, 0.06 + 1e-4 * i, 5e-3 / 2.2**i, form=form)
        for i, name in enumerate([*[*SOLVERS][:8], long])
        for form in ("quaternion", "own_form:Directions" if name == long else "euler-angles")
    ]
    figure = work_precision_panels(frame([*RECORDS, *front]), "slow_error", "error of L and E")
    figure.canvas.draw()
    (panel,) = figure.axes
    names = {text.get_text(): Text.get_window_extent(text) for text in panel.texts}
    assert f"{long},\nquaternion" in names
    assert len(names) >= 9
    boxes = sorted(names.values(), key=lambda box: box.y0)
    assert all(below.y1 <= above.y0 + 1 for below, above in pairwise(boxes))
    assert all(box.x0 >= panel.get_window_extent().x1 for box in boxes)
    behind = [line for line in panel.get_lines() if str(line.get_label()).startswith("_cyrk-radau")]
    assert {line.get_color() for line in behind if line.get_fillstyle() != "none"} == {BEHIND}
    plt.close(figure)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (1e-4, "$10^{-4}$"),
        (1e8, "$10^{8}$"),
        (100.0, "100"),
        (0.1, "0.1"),
        (250.0, "250"),
        (0, "0"),
        (5e4, r"$5\times10^{4}$"),
    ],
)
def test_powers_of_ten(value: float, text: str):
    assert power(value) == text


@pytest.mark.parametrize(("numbers", "visible"), [((1e2,), 1), ((1e2, 1e3, 1e4), 3)])
def test_one_panel_per_st(tmp_path: Path, numbers: tuple[float, ...], visible: int):
    records = [{**record, "scene": {"stokes": stokes}} for stokes in numbers for record in RECORDS]
    figure = work_precision_panels(frame(records), "slow_error", "error of L and E over I_max")
    panels = [axes for axes in figure.axes if axes.get_visible()]
    assert len(panels) == visible
    labels = {1e2: "100", 1e3: "$10^{3}$", 1e4: "$10^{4}$"}
    assert [axes.get_title(loc="left") for axes in panels] == [
        f"St = {labels[stokes]}" for stokes in numbers
    ]
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert len(names) == len(set(names)) == 5
    figure.canvas.draw()
    named = [
        axes
        for axes in panels
        if axes.get_xlabel() and axes.xaxis.get_ticklabels()[0].get_visible()
    ]
    assert named == panels[-1:], "the lowest panel names the axis"
    low, high = panels[0].get_xlim()
    assert low > 2e-2 > 1e-8 > high, "more accurate to the right"
    save(figure, tmp_path, "picture")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["picture.png"]
    assert (tmp_path / "picture.png").read_bytes().startswith(b"\x89PNG")
    assert figure.number not in plt.get_fignums()


def test_decades_of_error_and_time_are_as_long():
    records = [
        {**record, "scene": {"stokes": stokes}} for stokes in (1e2, 1e3) for record in RECORDS
    ]
    figure = work_precision_panels(
        frame(records), "slow_error", "error of L and E", note="Some words."
    )
    figure.canvas.draw()
    for axes in figure.axes:
        box = axes.get_window_extent()
        (low, high), (bottom, top) = (
            np.log10(sorted(limits())) for limits in (axes.get_xlim, axes.get_ylim)
        )
        assert box.width / (high - low) == pytest.approx(box.height / (top - bottom), rel=1e-6)
    plt.close(figure)


def test_words_stand_in_ink_beside_a_marker_in_the_solvers_colour():
    figure = work_precision_panels(frame(RECORDS), "slow_error", "error of L and E", scene="paper")
    (panel,) = figure.axes
    names = [text for text in panel.texts if text.get_text() in SOLVERS]
    assert names
    texts = [*figure.texts, *panel.texts, *figure.legends[0].get_texts(), panel.xaxis.label]
    assert {to_hex(text.get_color()).upper() for text in texts} <= {INK, SOFT}
    marks = {to_hex(line.get_color()).upper() for line in figure.artists}
    assert {colour(text.get_text()) for text in names} <= marks
    assert panel.get_title(loc="left").startswith("paper, St = ")
    plt.close(figure)


def test_what_was_measured_is_said_below_the_panels():
    table = frame(RECORDS).assign(seconds_spread=lambda runs: 0.1 * runs["seconds"])
    words = conditions(table, "A CPU, 2 cores")
    assert words == (
        "Tolerances 1e-4 to 1e-8. Times: warm runs, the fastest of up to 5, which vary by 10 % in the "
        "median; A CPU, 2 cores."
    )
    figure = work_precision_panels(table, "slow_error", "error of L and E", note=words)
    assert " ".join(figure.texts[-1].get_text().split()) == " ".join(words.split())
    plt.close(figure)


def test_a_study_in_which_every_run_failed_is_drawn_empty(tmp_path: Path):
    records = [run("cyrk-radau", tolerance, None, None) for tolerance in (1e-4, 1e-8)]
    figure = work_precision_panels(frame(records), "slow_error", "error of L and E")
    assert len(figure.axes[0].get_lines()) == 2
    save(figure, tmp_path, "picture")


def test_exact_solutions_without_error_are_drawn_at_no_place_but_do_not_stop_the_others(
    tmp_path: Path,
):
    both = RECORDS, [*RECORDS, run("exact", 1e-4, 0.1, 0.0)]
    without, figure = (
        work_precision_panels(frame(records), "slow_error", "error of L and E") for records in both
    )
    assert figure.axes[0].get_xlim() == without.axes[0].get_xlim()
    save(figure, tmp_path, "picture")
    plt.close(without)
