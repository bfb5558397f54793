"""Figures: what is drawn is what the records say."""

from pathlib import Path

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest

from polhode.harness.figures import (
    EXPLICIT,
    IMPLICIT,
    library_of,
    mark_too_slow,
    pareto_front,
    save,
    work_precision,
    work_precision_panels,
)
from polhode.harness.tables import frame
from polhode.solvers.catalogue import SOLVERS

mpl.use("Agg")
import matplotlib.pyplot as plt


def run(solver: str, tolerance: float, seconds: float | None, error: float | None, **more: object) -> dict:
    return {
        "form": "quaternion",
        "solver": solver,
        "tolerance": tolerance,
        "scene": {"stokes": 100.0},
        "status": "reached_end" if seconds is not None else "time_limit",
        "seconds": seconds,
        "slow_error": error,
        "orientation_error": None if error is None else 10 * error,
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
    drawn = {line.get_label(): np.column_stack([*line.get_data()]).tolist() for line in axes.get_lines()}
    assert drawn["taylor"] == [[1e-4, 0.1], [1e-8, 0.2]]
    assert drawn["cyrk-radau"] == [[1e-3, 0.3]]
    assert drawn["cyrk-dop853"] == [[1e-2, 0.05]]
    assert drawn["averaged form, cheapest runs"] == [[2e-2, 0.01], [1.9e-2, 0.02]]
    assert drawn["averaged form, model error"] == [[1.9e-2, 0], [1.9e-2, 1]]
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")


def test_methods_of_one_library_differ_in_marker_or_colour(axes):
    records = [run(name, 1e-4, 0.1, 1e-4) for name in SOLVERS if name != "exact"]
    lines = work_precision(axes, frame(records)).get_lines()
    assert len({(line.get_color(), line.get_marker()) for line in lines}) == len(records)


def test_every_library_has_a_colour():
    assert {library_of(name) for name in SOLVERS} <= set(EXPLICIT)
    assert set(EXPLICIT) == set(IMPLICIT)
    assert library_of("ida") == library_of("cvode-bdf") == "SUNDIALS"


def test_pareto_front():
    points = [(1.0, 1e-2), (2.0, 1e-4), (3.0, 1e-3), (4.0, 1e-8), (4.0, 1e-9), (5.0, 1e-9), (0.5, 1.0)]
    runs = pd.DataFrame(points, columns=["seconds", "slow_error"])
    front = pareto_front(runs)
    assert list(front["seconds"]) == [0.5, 1.0, 2.0, 4.0]
    assert list(front["slow_error"]) == [1.0, 1e-2, 1e-4, 1e-9]


def test_pareto_front_against_brute_force():
    generator = np.random.default_rng(5)
    runs = pd.DataFrame({"seconds": generator.random(60), "slow_error": generator.random(60)})
    better = [
        not any((o.seconds < r.seconds) and (o.slow_error < r.slow_error) for o in runs.itertuples())
        for r in runs.itertuples()
    ]
    assert set(pareto_front(runs).index) == set(runs.index[better])


def test_stopped_methods_are_listed(axes):
    mark_too_slow(axes, frame([*RECORDS, run("cyrk-radau", 1e-10, None, None)]))
    (text,) = axes.texts
    assert "cyrk-radau 1e-08" in text.get_text()
    assert "taylor" not in text.get_text()


def test_nothing_is_listed_where_nothing_was_stopped(axes):
    mark_too_slow(axes, frame(RECORDS[:3]))
    assert not axes.texts


@pytest.mark.parametrize(("numbers", "visible"), [((1e2,), 1), ((1e2, 1e3, 1e4), 3)])
def test_one_panel_per_st(tmp_path: Path, numbers: tuple[float, ...], visible: int):
    records = [{**record, "scene": {"stokes": stokes}} for stokes in numbers for record in RECORDS]
    figure = work_precision_panels(frame(records), "slow_error", "slow error over I_max")
    panels = [axes for axes in figure.axes if axes.get_visible()]
    assert len(panels) == visible
    assert [axes.get_title() for axes in panels] == [f"St = {stokes:g}" for stokes in numbers]
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert len(names) == len(set(names)) == 5
    low, high = panels[0].get_xlim()
    assert low > 2e-2 > 1e-8 > high, "more accurate to the right"
    save(figure, tmp_path, "picture", ("png", "svg"))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["picture.png", "picture.svg"]
    assert (tmp_path / "picture.png").read_bytes().startswith(b"\x89PNG")
    assert not plt.get_fignums()


def test_a_study_in_which_every_run_failed_is_drawn_empty(tmp_path: Path):
    records = [run("cyrk-radau", tolerance, None, None) for tolerance in (1e-4, 1e-8)]
    figure = work_precision_panels(frame(records), "slow_error", "slow error")
    assert "cyrk-radau 1e-04" in figure.axes[0].texts[0].get_text()
    save(figure, tmp_path, "picture")


def test_exact_solutions_without_error_are_drawn_at_no_place_but_do_not_stop_the_others(tmp_path: Path):
    figure = work_precision_panels(frame([*RECORDS, run("exact", 1e-4, 0.1, 0.0)]), "slow_error", "slow error")
    save(figure, tmp_path, "picture")
