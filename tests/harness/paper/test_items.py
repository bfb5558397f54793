"""Every item of the reproduction on its reduced grid: the measured numbers, the figure, the words around them."""

from functools import cache

import numpy as np
import pytest

from polhode.harness.paper.claims import find_items, items, sections
from polhode.harness.paper.drawing import style
from polhode.harness.paper.item import Grid, Word
from polhode.harness.paper.sections.spheroids import outside
from polhode.harness.paper.store import read, write

pytestmark = pytest.mark.usefixtures("quickly_compiled")

# Sections of prolate bodies, one with a layer of chaos and one without, run the code of those of
# oblate ones.
SLOW = ("poincare-flat", "poincare-fat-oblate")
ITEMS = pytest.mark.parametrize(
    "item",
    [
        pytest.param(item, id=item.name, marks=[pytest.mark.slow] * (item.name in SLOW))
        for item in items()
    ],
)


@pytest.fixture(scope="module")
def data_of(tmp_path_factory):
    """Data of an item on the reduced grid, as they come back from their files."""
    folder = tmp_path_factory.mktemp("paper")

    @cache
    def data(item):
        write(folder, item, Grid.REDUCED, item.experiment.compute(Grid.REDUCED))
        found = read(folder, item)
        assert found is not None
        return found[0]

    return data


@ITEMS
def test_every_number_lies_in_its_range(item, data_of):
    verdict = item.experiment.judge(data_of(item))
    outside = [number for number in verdict.numbers if not number.holds]
    assert not outside
    assert verdict.word is verdict.earned is not Word.NOT_CONFIRMED
    assert any(number.expected for number in verdict.numbers)


@ITEMS
def test_figure_has_labelled_axes(item, data_of):
    with style():
        figure = item.experiment.draw(data_of(item))
    drawn = [axes for axes in figure.axes if axes.has_data() and axes.get_label() != "<colorbar>"]
    assert drawn
    for axes in drawn:
        assert axes.get_xlabel()
        assert axes.get_ylabel()
        assert getattr(axes, "get_zlabel", lambda: "flat")()


@ITEMS
def test_words_are_complete(item, data_of):
    data = data_of(item)
    for text in (
        item.claim,
        item.experiment.judge(data).sentence,
        item.experiment.judge(data).caption,
    ):
        assert text.endswith((".", "?"))
        assert "nan" not in text.split()


def test_names_are_unique():
    names = [item.name for item in items()] + [section.name for section in sections()]
    assert len(names) == len(set(names))


def test_a_section_stands_for_its_items():
    section = sections()[0]
    assert find_items((section.name,)) == section.items
    assert find_items(()) == items()


def test_unknown_items_are_refused():
    with pytest.raises(ValueError, match="expected one of period-change"):
        find_items(("no-such-item",))


def test_a_path_lies_outside_two_others_by_its_distance_from_them():
    # A half disc above its diameter; its points are dense enough for a distance of 1e-4.
    angle = np.linspace(np.pi, 0.0, 1001)
    bow, chord = (
        np.stack([np.cos(angle), np.sin(angle)], axis=1),
        np.array([[-1.0, 0.0], [1.0, 0.0]]),
    )
    assert outside(bow * [0.9, 0.5] + [0.0, 0.1], bow, chord) == 0.0
    assert outside(np.array([[0.5, 0.2], [0.3, -0.2], [0.0, 1.1]]), chord, bow) == pytest.approx(
        0.2
    )
    assert outside(np.array([[0.6, 0.8]]) * 1.25, bow, chord) == pytest.approx(0.25, rel=1e-4)
