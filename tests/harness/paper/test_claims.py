"""Words meet facts: fields, bounds, lists, items that are like others; the law of jumps and the end of turning."""

from math import pi
from types import ModuleType

import numpy as np
import pytest
from scipy import stats

from polhode.harness.common.text import WORDING
from polhode.harness.paper import claims
from polhode.harness.paper.claims import drawn, facts_of, judged
from polhode.harness.paper.item import Word
from polhode.harness.paper.sections.beyond import (
    SPREAD,
    fitted_level,
    law,
    two_laws,
    typical_errors,
)
from polhode.harness.paper.sections.periods import turns
from polhode.harness.paper.tables import Estimate

ENTRY = {
    "verdict": "confirmed",
    "facts": {"twice": "2 * bound", "bound": "twice / 4"},
    "found": "κ = {kappas:g}, error {error:short}, {'in bounds' if error < bound else 'off'}.",
    "caption": "A line.",
    "numbers": [
        {"value": "error", "what": "error", "high": "bound", "unit": "rad"},
        {
            "each": "kappas",
            "value": "slope",
            "what": "slope, κ = {each:g}",
            "near": "expected",
            "within": 0.1,
        },
    ],
}
FACTS = {
    "kappas": (2.0, 3.0),
    "error": Estimate(1e-7, (0.0, 1.0)),
    "bound": 2e-6,
    "slope": [Estimate(1.0, (0.9, 1.1)), Estimate(2.0, (1.9, 2.1))],
    "expected": [1.05, 2.05],
}


def verdict_on(entry, names):
    return judged(entry, facts_of(entry, names))


def test_words_and_numbers_of_an_entry():
    verdict = verdict_on(ENTRY, FACTS)
    assert verdict.word is Word.CONFIRMED
    assert verdict.sentence == "κ = 2, 3, error 1e-7, in bounds."
    first, second, third = verdict.numbers
    assert (first.high, first.unit, first.interval) == (1e-6, "rad", (0.0, 1.0))
    assert (second.what, third.what) == ("slope, κ = 2", "slope, κ = 3")
    assert (third.value, third.low, third.high) == pytest.approx((2.0, 1.95, 2.15))
    assert third.interval == (1.9, 2.1)


def test_a_fact_out_of_bounds_takes_the_verdict_away():
    assert verdict_on(ENTRY, {**FACTS, "slope": [1.0, 2.3]}).word is Word.NOT_CONFIRMED
    assert verdict_on(ENTRY, {**FACTS, "bound": 1e-8}).word is Word.NOT_CONFIRMED


def test_missing_facts_are_errors():
    with pytest.raises(NameError):
        verdict_on(ENTRY, {"kappas": (), "bound": 1.0})


@pytest.mark.parametrize("wrong", [{"hihg": 1.0}, {"near": "expected"}, {"within": 0.1}])
def test_misspelt_bounds_are_errors(wrong):
    with pytest.raises(ValueError, match=f"numbers: got {next(iter(wrong))}, expected"):
        verdict_on({**ENTRY, "numbers": [{"value": "error", "what": "error", **wrong}]}, FACTS)


def test_an_item_like_none_is_an_error(monkeypatch, tmp_path):
    (tmp_path / "some.toml").write_text('title = "Some"\n[one]\nlike = "other"\n', encoding="utf-8")
    monkeypatch.setattr(claims, "files", lambda package: tmp_path)
    with pytest.raises(ValueError, match="like: got other, expected one of one"):
        claims._entries.__wrapped__()


def test_a_name_that_means_two_things_is_an_error():
    """`drawing` has a colour of this name."""
    module = ModuleType("odd")
    vars(module).update(pi=pi, BLUE="#000001")
    with pytest.raises(
        ValueError, match="odd: got other values of BLUE, expected names of its own"
    ):
        claims.names_of(module)


def test_formats_of_the_pages():
    assert WORDING.format("{0:two} {1:.1f}", 5931.0, np.array([1.0, 2.0])) == "5900 1.0, 2.0"


def test_law_of_jumps_is_the_distribution_of_its_formula():
    sample = (
        -np.log(2 * np.abs(np.sin(np.pi * np.random.default_rng(0).uniform(size=100_000)))) / SPREAD
    )
    assert sample.std() == pytest.approx(1.0, abs=0.02)
    for value in (-0.7, 0.0, 1.0, 3.0):
        assert np.mean(sample < value) == pytest.approx(law(np.array(value)), abs=0.006)


def test_fitted_level_of_the_law_is_passed_by_one_sample_in_twenty():
    samples = -np.log(2 * np.sin(np.pi * np.random.default_rng(2).uniform(size=(600, 64))))
    level = fitted_level(64)
    beyond = [
        stats.kstest((own - own.mean()) / own.std(), law).statistic > level for own in samples
    ]
    assert np.mean(beyond) == pytest.approx(0.05, abs=0.025)


@pytest.mark.parametrize(("alpha", "expected"), [(0.24, True), (0.26, False)])
def test_turning_ends_at_the_printed_threshold(alpha, expected):
    """κ = 2 without inertia in closed form, and with little inertia in time."""
    assert turns(2.0, 0.0, alpha) is expected
    assert turns(2.0, 0.5, alpha) is expected


def test_curves_of_a_described_figure():
    """One for each value of a key, in the colours of the cycle; a law ends at its last value."""
    table = np.rec.fromarrays(
        [[1.0, 1.0, 2.0], [1.0, 10.0, 1.0], [4.0, 5.0, 6.0]], names="kappa,x,y"
    )
    curves = [
        {"by": "kappa", "x": "x", "y": "shift + y", "label": "$\\kappa$ = {kappa:g}"},
        {"x": "x[:2]", "y": "y[1]", "slope": -1, "color": "ORANGE"},
        {"by": "kappa", "level": "y[0]", "color": "0.4"},
    ]
    entry = {
        "panels": [1, 1],
        "axes": [{"x": "x", "y": "y", "log": "x", "title": "{shift:g}", "curves": curves}],
    }
    (axes,) = drawn(entry, {"table": table, "shift": 0.5}).axes
    first, second, law, *levels = axes.lines
    assert [line.get_label() for line in (first, second)] == ["$\\kappa$ = 1", "$\\kappa$ = 2"]
    assert (first.get_ydata().tolist(), second.get_ydata().tolist()) == ([4.5, 5.5], [6.5])
    assert first.get_color() != second.get_color()
    # More curves than colours.
    many = np.rec.fromarrays([np.arange(9.0)] * 3, names="kappa,x,y")
    entry["axes"][0]["curves"] = [{"by": "kappa", "x": "x", "y": "part.y", "label": "{kappa:g}"}]
    assert len(drawn(entry, {"table": many, "shift": 0.5}).axes[0].lines) == 9
    assert (law.get_ydata().tolist(), law.get_color()) == ([50.0, 5.0], "#E69F00")
    assert [line.get_ydata()[0] for line in levels] == [4.0, 6.0]
    assert (axes.get_xscale(), axes.get_yscale(), axes.get_title()) == ("log", "linear", "0.5")


def test_axes_for_each_of_a_list():
    """Those of three dimensions among them; a curve without rows is an error, unless its condition says when it is."""
    table = np.rec.fromarrays([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]], names="x,y,z")
    curve = {
        "table": "table[table.x > bound]",
        "x": "x",
        "y": "y",
        "z": "each * z",
        "linewidth": "each",
    }
    panel = {
        "each": [1, 2],
        "facts": {"bound": "each - 1"},
        "title": "{each}",
        "curves": ["axes.set_xlabel('own')", curve],
    }
    entry = {"panels": [1, "1 + 1"], "options": {"spatial": [0, 1]}, "axes": [panel]}
    first, second = drawn(entry, {"table": table}).axes
    assert [axes.get_title() for axes in (first, second)] == ["1", "2"]
    assert [axes.get_xlabel() for axes in (first, second)] == ["own", "own"]
    assert second.lines[0].get_data_3d()[2].tolist() == [12.0]
    assert [axes.lines[0].get_linewidth() for axes in (first, second)] == [1, 2]
    panel["facts"]["bound"] = "each"
    with pytest.raises(
        ValueError, match=r"curve: got no rows of table\[table.x > bound\], expected some"
    ):
        drawn(entry, {"table": table})
    curve["when"] = "each < 2"
    assert [len(axes.lines) for axes in drawn(entry, {"table": table}).axes] == [1, 0]


def test_a_jump_and_a_scattering_differ_in_how_they_fall():
    stokes = np.geomspace(1e4, 1e7, 7)
    errors = np.sqrt((18 / stokes) ** 2 + 0.03**2 / stokes)
    rows = [
        (n, factor * error) for n, error in zip(stokes, errors, strict=True) for factor in (0.1, 10)
    ]
    table = np.rec.fromrecords(rows, names="stokes,error")
    assert two_laws(stokes, typical_errors(table)) == pytest.approx((18, 0.03), rel=1e-9)
    assert two_laws(stokes, 18 / stokes) == pytest.approx((18, 0))
