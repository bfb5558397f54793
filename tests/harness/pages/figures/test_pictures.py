"""Pictures of pages: distributions, heat maps and ensembles show the rows that they are drawn from."""

from pathlib import Path
from shutil import copytree

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from commandline import Run
from PIL import Image

from polhode.harness.pages import pick as pick_page
from polhode.harness.pages.figures.averaging import Band, bands
from polhode.harness.pages.figures.ensembles import last_axis, picture, speeds
from polhode.harness.pages.figures.hybrid import errors_and_speed
from polhode.harness.pages.figures.orders import Line, against_stokes
from polhode.harness.pages.figures.style import repeats_vary
from polhode.harness.pages.figures.work_precision import heat_map

mpl.use("Agg")
import matplotlib.pyplot as plt

REPORTS = Path(__file__).parents[4] / "reports"


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


def circles(axes) -> list[list[float]]:
    """Points that are circled."""
    lines = [line for line in axes.get_lines() if line.get_fillstyle() == "none"]
    return [point for line in lines for point in np.asarray(line.get_xydata()).tolist()]


def test_runs_of_hybrid_beyond_the_error_allowed_are_circled():
    runs = pd.DataFrame(
        [
            {"stokes": 1e5, "error": 1e-6, "slow": 5e-7, "uncertainty": 1e-9},
            {"stokes": 1e5, "error": 1e-6, "slow": 2e-6, "uncertainty": 1e-9},
            # Within what the reference knows.
            {"stokes": 1e5, "error": 1e-6, "slow": 3e-6, "uncertainty": 4e-6},
            {"stokes": 1e6, "error": 1e-6, "slow": 1e-12, "uncertainty": 1e-9},
        ]
    )
    gains = pd.DataFrame(
        [
            {"stokes": 1e6, "bodies": bodies, "gain": gain}
            for bodies, gain in (("spheroids", 80.0), ("spheroids", 90.0), ("triaxial", 2.0))
        ]
    )
    figure = errors_and_speed(runs, gains, "Made here.")
    errors, speed = figure.axes
    assert circles(errors) == [[pytest.approx(2.0), pytest.approx(1.0)]]
    assert errors.get_title(loc="left") == "Error $10^{-6}$"
    steps = [line for line in speed.get_lines() if line.get_drawstyle() != "default"]
    assert {(line.get_linestyle(), min(line.get_xdata())) for line in steps} == {
        ("-", 80.0),
        ("--", 2.0),
    }
    keys = [text.get_text() for text in figure.legends[0].get_texts()]
    assert keys == ["St = $10^{5}$", "St = $10^{6}$", "missed"]
    assert "Made here." in figure.texts[-1].get_text()
    shades = {line.get_color() for line in errors.get_lines() if line.get_drawstyle() != "default"}
    assert len(shades) == 2, "a colour for each St"


def test_a_heat_map_shows_the_ratio_to_the_fastest():
    index = pd.MultiIndex.from_product([[1e-3, 1e-6], ["one", "two"]])
    ratios = pd.DataFrame(
        {"taylor": [1.0, 3.0, 1.0, np.nan], "radau": [2.5, 1.0, 40.0, 1.0]}, index=index
    )
    figure = heat_map(ratios, ["loose", "tight"], "Made here.")
    loose, tight = figure.axes
    assert [axes.get_title(loc="left") for axes in (loose, tight)] == ["loose", "tight"]
    texts = {text.get_position(): text.get_text() for text in loose.texts}
    assert texts == {(0.5, 0.5): "1", (1.5, 0.5): "2.5", (0.5, 1.5): "3", (1.5, 1.5): "1"}
    texts = {text.get_position(): text.get_text() for text in tight.texts}
    # 40 times as long is a colour alone, what no run reaches is white.
    assert texts == {(0.5, 0.5): "1", (1.5, 1.5): "1"}
    assert np.ma.getmaskarray(tight.collections[0].get_array())[1, 0] or np.isnan(
        tight.collections[0].get_array()[1, 0]
    )
    assert [label.get_text() for label in tight.get_xticklabels()] == ["taylor", "radau"]


@pytest.mark.parametrize(
    ("axes", "words"),
    [
        ((1, 1, 2), "symmetry axis, longest"),
        ((1, 1, 0.5), "symmetry axis, shortest"),
        ((1, 0.8, 0.5), "shortest axis"),
        ((1, 0.5, 0.8), "last axis"),
    ],
)
def test_which_axis_p_is(axes: tuple[float, ...], words: str):
    assert last_axis(axes) == words


def decade(axes) -> tuple[float, float]:
    """Lengths of a decade of x and of y, in pixels, once the figure has been drawn."""
    x, y = (limits[0] for limits in (axes.get_xlim(), axes.get_ylim()))
    corner, right, above = (axes.transData.transform((a * x, b * y)) for a, b in _ONE_DECADE)
    return right[0] - corner[0], above[1] - corner[1]


_ONE_DECADE = ((1, 1), (10, 1), (1, 10))


def test_slopes_are_as_steep_as_they_are():
    stokes = [1e2, 1e4, 1e6]
    errors = [1e-2, 1e-4, 1e-6]
    band = Band("first order", False, stokes, errors, errors, errors)
    line = Line(1, 1, stokes, errors)
    eight = {str(number): [band] for number in range(8)}
    three = {name: [line] for name in "abc"}
    for figure in (
        bands(eight, "Made here."),
        against_stokes(three, "error", "Made here."),
    ):
        figure.canvas.draw()
        for axes in figure.axes:
            x, y = decade(axes)
            assert x == pytest.approx(y, rel=1e-6)
            assert axes.get_position().x1 <= 1 + 1e-6, "within the picture"
    first = bands({"one": [band]}).axes[0]
    assert {text.get_text() for text in first.texts} == {"1/St", "1/St²"}


def test_bands_tell_orders_and_crossing_bodies_apart():
    stokes = [1e2, 1e4, 1e6]
    first, second = [1e-2, 1e-4, 1e-6], [1e-3, 1e-5, 1e-7]
    # Too many bodies are refused at the smallest St.
    broken = Band("second order", False, stokes, second, second, [np.inf, 1e-4, 1e-6])
    crossing = Band("first order", True, stokes, first, first, first)
    panels = {"any": [Band("first order", False, stokes, first, first, first), broken, crossing]}
    figure = bands(panels | {"rest": []}, "Made here.", {"rest": "all refused: L = 0"})
    figure.canvas.draw()
    axes, refused, unused = figure.axes
    assert [text.get_text() for text in refused.texts] == ["all refused: L = 0"]
    assert not unused.get_visible()
    places = [axes.get_position(original).bounds for original in (False, True)]
    assert places[0] == pytest.approx(places[1]), "the panel fills its place"
    once, hatched, crossed = axes.collections
    assert [area.get_hatch() for area in (once, hatched, crossed)] == [None, "////", None]
    assert once.get_facecolor().tolist() != crossed.get_facecolor().tolist()
    # The edges of a band are unknown where one of them is; its line is not.
    dashed = [line for line in axes.get_lines() if line.get_linestyle() == "--"]
    known = [np.isfinite(line.get_ydata()).tolist() for line in dashed]
    assert known == [[False, True, True], [False, True, True], [True, True, True]]
    (legend,) = figure.legends
    labels = [text.get_text() for text in legend.get_texts()]
    assert labels == ["first order", "second order", "first order, crossing L² = 2EI₂"]
    assert [place for place in axes.get_xticks() if 10 <= place <= 1e8] == [1e2, 1e4, 1e6, 1e8]


def test_each_prediction_is_drawn_from_the_errors_of_its_order_and_power():
    stokes = [1e2, 1e4]
    lines = [Line(2, 1, stokes, [1e-2, 1e-4]), Line(2, 2, stokes, [1e-5, 1e-9])]
    (axes,) = against_stokes({"one": lines}, "error").axes
    dotted = [line.get_ydata() for line in axes.get_lines() if line.get_linestyle() == ":"]
    assert np.allclose(dotted, [line.error for line in lines], rtol=1e-9, atol=0.0)


def test_the_sketch_of_a_body_shows_its_last_axis():
    (sketch,) = picture(tables()).axes[0].child_axes
    (arrow, name) = sketch.texts
    tip, tail = np.array(arrow.xy), np.array(arrow.xyann)
    assert name.get_text() == "p"
    assert np.linalg.norm(tip) > np.linalg.norm(tail), "outwards"
    outline = sketch.patches[0].get_xy()
    far = outline[np.argmax(np.linalg.norm(outline, axis=1))]
    # The last axis is the longest here.
    assert abs(np.dot(far, tip)) / np.linalg.norm(far) / np.linalg.norm(tip) > 0.99


def tables(stokes: tuple[float, ...] = (500.0, 5000.0)) -> dict[str, pd.DataFrame]:
    """Rows of a spheroid's files, at two times."""
    shape = {"a": 1.0, "b": 1.0, "c": 2.0}
    moments, distributions, arrivals = [], [], []
    for number in stokes:
        for time in (0.0, 0.5 * number):
            row = shape | {"stokes": number, "time": time}
            arrivals.append(
                row
                | {"attractor": "equatorial axis"}
                | {"fraction": time / number, "low": 0.0, "high": 1.0}
            )
            for moment, mean in (("xx", 0.5), ("yy", 0.5), ("zz", time / number), ("xy", 9.0)):
                moments.append(
                    row | {"body_axis": 3, "moment": moment, "mean": mean, "standard_error": 0.01}
                )
            distributions += [
                row | {"variable": "Lz/Imax", "low": low, "high": low + 0.1, "particles": count}
                for low, count in ((-0.5, 30), (-0.4, 10))
            ]
    return {
        "moments": pd.DataFrame(moments),
        "slow": pd.DataFrame(),
        "distributions": pd.DataFrame(distributions),
        "arrivals": pd.DataFrame(arrivals),
    }


def test_a_shape_is_drawn_from_its_tables_with_direct_names():
    figure = picture(tables(), "Made here.")
    means, arrived = figure.axes
    assert means.get_title(loc="left") == "p: symmetry axis, longest"
    assert {text.get_text() for text in means.texts} == {"$p_x^2$", "$p_y^2$", "$p_z^2$"}
    places = sorted(text.get_position()[1] for text in means.texts)
    assert min(np.diff(places)) >= 0.09 - 1e-9, "no two names on each other"
    assert len(means.get_lines()) == 6, "three components at two St"
    assert arrived.get_title(loc="left") == "About the equatorial axis"
    assert max(np.max(line.get_xdata()) for line in arrived.get_lines()) == pytest.approx(0.5)
    (inset,) = arrived.child_axes
    shares = inset.patches[0].get_data().values
    np.testing.assert_allclose(shares, [0.75, 0.25])
    keys = [text.get_text() for text in figure.legends[0].get_texts()]
    assert keys == ["1 : 1 : 2, St = 500", r"1 : 1 : 2, St = $5\times10^{3}$"]


def test_p_is_the_symmetry_axis_of_a_spheroid_wherever_it_stands():
    given = tables((1000.0,))
    for name in ("moments", "distributions", "arrivals"):
        given[name] = given[name].assign(a=2.0, b=1.0, c=1.0)
    given["moments"]["body_axis"] = 1
    means = picture(given).axes[0]
    assert means.get_title(loc="left") == "p: symmetry axis, longest"
    (sketch,) = means.child_axes
    tip = np.array(sketch.texts[0].xy)
    outline = sketch.patches[0].get_xy()
    far = outline[np.argmax(np.linalg.norm(outline, axis=1))]
    assert abs(np.dot(far, tip)) / np.linalg.norm(far) / np.linalg.norm(tip) > 0.99


def test_an_empty_bin_of_a_histogram_has_no_particles():
    given = tables((1000.0,))
    rows = given["distributions"]
    # Bins from -0.5 to -0.4 and from -0.2 to -0.1; those between are empty.
    given["distributions"] = rows.assign(
        low=rows["low"].replace(-0.4, -0.2), high=rows["high"].replace(-0.4 + 0.1, -0.1)
    )
    (inset,) = picture(given).axes[1].child_axes
    shares, edges, _ = inset.patches[0].get_data()
    np.testing.assert_allclose(edges, [-0.5, -0.4, -0.2, -0.1])
    np.testing.assert_allclose(shares, [0.75, 0.0, 0.25])


def test_without_orientations_means_of_l_are_drawn():
    given = tables((1000.0,))
    rows = given["moments"].rename(columns={"moment": "variable"})
    rows["variable"] = rows["variable"].map({"xx": "Lx/Imax", "yy": "Ly/Imax", "zz": "Lz/Imax"})
    figure = picture(given | {"moments": pd.DataFrame(), "slow": rows, "arrivals": pd.DataFrame()})
    means, arrived = figure.axes
    assert means.get_title(loc="left") == "Means of L"
    assert {text.get_text() for text in means.texts} == {"$L_x$", "$L_y$", "$L_z$"}
    assert arrived.get_title(loc="left") == "No attractor is named"


def test_speeds_stand_on_square_decades():
    rows = [
        {"shape": "1 : 1 : 2", "error": 1e-6, "per_second": 1e5}
        | {"taylor_error": 1e-6, "taylor_per_second": 2e4}
    ]
    figure = speeds(rows)
    (axes,) = figure.axes
    assert axes.get_aspect() == 1.0
    drawn = [np.asarray(line.get_xydata()).tolist() for line in axes.get_lines()]
    assert drawn == [[[1e-6, 1e5]], [[1e-6, 2e4]]]
    assert not axes.collections, "no spread was kept"
    spread = {"slower_per_second": 8e4, "taylor_slower_per_second": 1e4}
    (axes,) = speeds([rows[0] | spread]).axes
    bars = [bar.get_segments()[0].tolist() for bar in axes.collections]
    assert bars == [[[1e-6, 8e4], [1e-6, 1e5]], [[1e-6, 1e4], [1e-6, 2e4]]]


def test_how_far_repeats_vary_is_said_where_it_is_known():
    seconds = pd.Series([1.0, 2.0, 4.0, np.inf])
    spreads = pd.Series([0.1, 0.4, np.nan, np.nan])
    assert repeats_vary(seconds, spreads) == "vary by 15 % in the median"
    assert repeats_vary(seconds, spreads * np.nan) == ""
    # First choices, and best runs where these are others.
    scenes = pd.DataFrame(
        {
            "choice": ["a", "b"],
            "best": ["a", "c"],
            "seconds": [1.0, 2.0],
            "best_seconds": [1.0, 1.0],
        }
    )
    assert pick_page._repeats(scenes) == "the spread of repeats was not kept"
    scenes = scenes.assign(seconds_spread=[0.1, 0.6], best_seconds_spread=[0.1, 0.2])
    assert pick_page._repeats(scenes) == "the repeats vary by 20 % in the median"


@pytest.mark.skipif(not REPORTS.is_dir(), reason="no committed pages here")
@pytest.mark.parametrize(
    ("words", "name", "drawn"),
    [
        (("sweep",), "sweep", ("shape-1", "shape-2", "shape-3")),
        (("throughput",), "sweep", ("throughput",)),
        (("validate",), "pick", ("choices",)),
        (("equal-error",), "solvers", ("slow",)),
        (("bench", "--problems"), "problems", ("work-precision", "profiles")),
    ],
)
def test_pages_are_written_anew_from_their_data(
    here: Run, tmp_path: Path, words: tuple[str, ...], name: str, drawn: tuple[str, ...]
):
    folder = tmp_path / "copy"
    copytree(REPORTS / name, folder)
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    for picture_name in drawn:
        (folder / f"{picture_name}.png").unlink()
    done = here(*words, "--page-only", "--out", folder)
    assert (done.returncode, done.stderr) == (0, "")
    for path in folder.iterdir():
        if path.suffix != ".png":
            assert path.read_bytes() == before[path.name], path.name
    for picture_name in drawn:
        with Image.open(folder / f"{picture_name}.png") as image:
            assert image.width == 838


@pytest.mark.parametrize(
    "words", [("sweep",), ("throughput",), ("validate",), ("equal-error",), ("bench", "--problems")]
)
def test_without_data_no_page_is_written_anew(here: Run, tmp_path: Path, words: tuple[str, ...]):
    done = here(*words, "--page-only", "--out", tmp_path / "none")
    assert done.returncode == 2
    assert "no such file, expected" in done.stderr
    assert done.stderr.count("\n") == 1
