"""Ranges and verdicts; curves of tables; the law of jumps and the end of turning."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy import stats

from polhode.harness.common.text import WORDING
from polhode.harness.paper import store
from polhode.harness.paper.claims import items, section_of
from polhode.harness.paper.drawing import draw_each, draw_levels, draw_power
from polhode.harness.paper.item import Number, Range, Verdict, Word
from polhode.harness.paper.sections.beyond import (
    SPREAD,
    fitted_level,
    law,
    two_laws,
    typical_errors,
)
from polhode.harness.paper.sections.limits import LIMITS_SECTION
from polhode.harness.paper.sections.periods import turns

TABLE = np.rec.fromarrays([[1.0, 1.0, 2.0], [1.0, 10.0, 1.0], [4.0, 5.0, 6.0]], names="kappa,x,y")


def test_a_number_out_of_its_range_takes_the_verdict_away():
    inside = Number("slope", -1.05, Range.near(-1.0, 0.1, "theory"))
    outside = Number("slope", -1.2, Range.near(-1.0, 0.1, "theory"))
    free = Number("size", 3.0)
    assert Verdict(Word.SHARPENED, "", "", [inside, free]).word is Word.SHARPENED
    assert Verdict(Word.SHARPENED, "", "", [inside, outside]).word is Word.NOT_CONFIRMED


def test_every_range_says_why():
    """As far as it is known without data: reasons stand in the settings."""
    for item in items():
        for value in vars(item.experiment).values():
            if isinstance(value, Range):
                assert value.reason, item.name


def test_a_curve_for_each_value_of_a_key():
    axes = Figure().subplots()
    draw_each(axes, TABLE, "kappa", "x", lambda rows: 0.5 + rows.y, label="κ = {:g}".format)
    first, second = axes.lines
    assert [line.get_label() for line in (first, second)] == ["κ = 1", "κ = 2"]
    assert (first.get_ydata().tolist(), second.get_ydata().tolist()) == ([4.5, 5.5], [6.5])
    assert first.get_color() != second.get_color()


def test_more_curves_than_colours():
    axes = Figure().subplots()
    many = np.rec.fromarrays([np.arange(9.0)] * 3, names="kappa,x,y")
    draw_each(axes, many, "kappa", "x", "y")
    assert len(axes.lines) == 9


def test_a_power_law_ends_at_its_last_value():
    axes = Figure().subplots()
    draw_power(axes, np.array([1.0, 10.0]), 5.0, -1)
    assert axes.lines[0].get_ydata().tolist() == [50.0, 5.0]


def test_levels_are_the_first_values():
    axes = Figure().subplots()
    draw_levels(axes, TABLE, "kappa", "y")
    assert [line.get_ydata()[0] for line in axes.lines] == [4.0, 6.0]


def test_a_table_without_rows_is_a_mistake():
    with pytest.raises(ValueError, match="got a table without rows"):
        draw_each(Figure().subplots(), TABLE[:0], "kappa", "x", "y")


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


def test_a_jump_and_a_scattering_differ_in_how_they_fall():
    stokes = np.geomspace(1e4, 1e7, 7)
    errors = np.sqrt((18 / stokes) ** 2 + 0.03**2 / stokes)
    rows = [
        (n, factor * error) for n, error in zip(stokes, errors, strict=True) for factor in (0.1, 10)
    ]
    table = np.rec.fromrecords(rows, names="stokes,error")
    assert two_laws(stokes, typical_errors(table)) == pytest.approx((18, 0.03), rel=1e-9)
    assert two_laws(stokes, 18 / stokes) == pytest.approx((18, 0))


def test_a_share_says_of_what():
    """The name of a number holds the word where it is one; so do those of the report that is there."""
    report = Path(__file__).parents[3] / "reports" / "paper"
    shares = 0
    for item in items():
        found = store.judged(report / section_of(item).name, item)
        if isinstance(found, str):
            continue
        for number in found[1].numbers:
            if "share" in number.name.split():
                shares += 1
                assert number.measure, (item.name, number.name)
    assert shares > 10


def test_a_separatrix_without_a_layer_is_judged_by_its_width_and_its_orbits():
    """Rows as of the fat oblate body; a negative width has no orbits across, and confirms nothing."""
    (item,) = (one for one in LIMITS_SECTION.items if one.name == "poincare-fat-oblate")

    def judged(width: float, chaotic: list[float]) -> Verdict:
        starts = [[0.0, 0.0, 1.0, 2.0], [0.01, 0.02, 0.01, 0.03], chaotic]
        data = {
            "orbits": np.rec.fromarrays(starts, names="kind,exponent,chaotic"),
            "layer": np.rec.array(
                [(800.0, 0.27, 0.27 + width, width)],
                names="turns,librating,circulating,width",
            ),
            "saddle": np.rec.array([(0.15,)], names="growth"),
            "settings": np.rec.array([(3000.0,)], names="duration"),
        }
        return item.experiment.judge(data)

    sharp = judged(2e-15, [0.0, 0.0, 0.0, 0.0])
    assert sharp.word is Word.UNDECIDED
    assert sharp.sentence.endswith("As no orbit is chaotic, there may be none.")
    assert judged(2e-15, [0.0, 0.0, 0.0, 1.0]).sentence.endswith("chaotic: 1 of all starts.")
    negative = judged(-1e-5, [0.0, 0.0, 0.0, 0.0])
    assert negative.word is Word.NOT_CONFIRMED
    assert negative.sentence.endswith("whether there is a layer is not measured.")
