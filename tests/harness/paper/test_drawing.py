"""The look of the reproduction's figures: as wide as a page, nothing cut off, no name too long for its panel."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from polhode.harness.pages.figures.style import LETTERS, SERIES
from polhode.harness.paper.drawing import key_above, key_of, panels, save, style

REPORTS = Path(__file__).parents[3] / "reports" / "paper"
LONG = "largest error of L and E$/I_{max}$ over time"
NAME = "a name that is longer than a panel"


def drawn(folder: Path):
    """A figure of two panels with long labels, a key of its own each or one of all, as it is saved."""
    with style():
        figure, (left, right) = panels(1, 2, 4.0)
        for axes in (left, right):
            for number in range(4):
                axes.loglog([1, 10], [1, 10**number], label=f"{NAME}, {number}"[-12 * number - 3 :])
            axes.set(xlabel=LONG, ylabel=LONG, title="a title")
        key_of(right)
        key_above(figure, left)
        save(figure, folder, "picture")
    return figure, left, right


def test_a_figure_is_as_wide_as_a_page_and_nothing_is_cut_off(tmp_path: Path):
    figure, left, right = drawn(tmp_path)
    with Image.open(tmp_path / "picture.png") as image:
        assert image.width == 838
    page = figure.bbox
    # Pixels: Matplotlib 3.9 draws a legend 4 pixels over the edge, later ones none.
    allowed = 5
    legends = [*figure.legends, right.get_legend()]
    parts = [left.xaxis.label, left.yaxis.label, right.xaxis.label, right.yaxis.label, *legends]
    for part in parts:
        box = part.get_window_extent()
        assert page.x0 - allowed <= box.x0 <= box.x1 <= page.x1 + allowed
        assert page.y0 - allowed <= box.y0 <= box.y1 <= page.y1 + allowed
    assert left.xaxis.label.get_text().replace("\n", " ") == LONG
    assert "\n" in left.yaxis.label.get_text()


def test_a_key_above_a_panel_has_its_title_and_does_not_lie_on_it(tmp_path: Path):
    _, left, right = drawn(tmp_path)
    legend = right.get_legend()
    assert legend.get_title().get_text() == "a title"
    assert right.get_title(loc="left") == ""
    assert legend.get_window_extent().y0 >= right.get_window_extent().y1 - 1
    assert left.xaxis.label.get_fontsize() == LETTERS
    colours = [line.get_color() for line in left.get_lines()]
    assert colours == list(SERIES[:4])


@pytest.mark.skipif(not REPORTS.is_dir(), reason="no committed pages here")
def test_all_pictures_are_as_wide_as_a_page():
    widths = {}
    for path in REPORTS.rglob("*.png"):
        with Image.open(path) as image:
            widths[path.name] = image.width
            pixels = np.asarray(image.convert("L"))
        assert (pixels[:, [0, -1]] > 200).all(), f"{path.name}: something is cut off"
    assert set(widths.values()) == {838}, widths
