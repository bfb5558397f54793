"""One look for every solver, told apart by all eyes, on white and on a dark ground."""

import re
from collections.abc import Sequence
from itertools import combinations
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
from PIL import Image

from polhode.harness import site
from polhode.harness.pages.figures import style
from polhode.harness.pages.figures.map_picture import CODES, ink_on
from polhode.harness.pages.figures.motion import SLOW_COLOURS
from polhode.harness.pages.figures.style import (
    INK,
    LOOKS,
    OTHER,
    SERIES,
    SOFT,
    both_colours,
    caption,
    few_colours,
    looks,
    measured,
    panels,
    ramp,
    rank,
    save,
)
from polhode.solvers.catalogue import SOLVERS

# Linear sRGB as colour-blind eyes see it (Machado, Oliveira and Fernandes 2009, severity 1).
EYES = {
    "usual": np.eye(3),
    "protanopia": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deuteranopia": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "tritanopia": [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
}
XYZ = [
    [0.4124564, 0.3575761, 0.1804375],
    [0.2126729, 0.7151522, 0.0721750],
    [0.0193339, 0.1191920, 0.9503041],
]
WHITE = [0.95047, 1.0, 1.08883]
# Grounds of pages and figures.
GROUNDS = {"light": ("#FFFFFF",), "dark": ("#14181E", "#131416")}
LEAST_DISTANCE = 10.0  # CIEDE2000.
LEAST_CONTRAST = 3.0  # Of lines and points.
LEAST_TEXT_CONTRAST = 4.5


def linear(colour: str) -> np.ndarray:
    values = np.array([int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)])
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def contrast(one: str, other: str) -> float:
    """Of WCAG."""
    first, second = (float(np.dot([0.2126, 0.7152, 0.0722], linear(c))) for c in (one, other))
    return (max(first, second) + 0.05) / (min(first, second) + 0.05)


def lab(colour: str, eye: str) -> np.ndarray:
    """A colour in CIELAB, as an eye sees it."""
    seen = np.clip(np.array(EYES[eye]) @ linear(colour), 0, 1)
    x, y, z = (np.array(XYZ) @ seen) / WHITE
    f = [np.cbrt(v) if v > 216 / 24389 else (24389 / 27 * v + 16) / 116 for v in (x, y, z)]
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def distance(one: np.ndarray, other: np.ndarray) -> float:
    """CIEDE2000, by Sharma, Wu and Dalal (2005)."""
    mean = (np.hypot(*one[1:]) + np.hypot(*other[1:])) / 2
    stretch = 1 + 0.5 * (1 - np.sqrt(mean**7 / (mean**7 + 25.0**7)))
    chroma = [np.hypot(stretch * c[1], c[2]) for c in (one, other)]
    hue = [np.degrees(np.arctan2(c[2], stretch * c[1])) % 360 for c in (one, other)]
    grey = chroma[0] * chroma[1] == 0
    turn = 0.0 if grey else (hue[1] - hue[0] + 180) % 360 - 180
    between = hue[0] + hue[1] if grey else (hue[0] + turn / 2) % 360
    light, middle = (one[0] + other[0]) / 2, sum(chroma) / 2

    def cosine(degrees: float) -> float:
        return float(np.cos(np.radians(degrees)))

    t = 1 - 0.17 * cosine(between - 30) + 0.24 * cosine(2 * between)
    t += 0.32 * cosine(3 * between + 6) - 0.2 * cosine(4 * between - 63)
    rotation = 2 * np.sqrt(middle**7 / (middle**7 + 25.0**7))
    rotation *= -np.sin(np.radians(60 * np.exp(-(((between - 275) / 25) ** 2))))
    parts = (
        (other[0] - one[0]) / (1 + 0.015 * (light - 50) ** 2 / np.sqrt(20 + (light - 50) ** 2)),
        (chroma[1] - chroma[0]) / (1 + 0.045 * middle),
        2
        * np.sqrt(chroma[0] * chroma[1])
        * np.sin(np.radians(turn / 2))
        / (1 + 0.015 * middle * t),
    )
    return float(np.sqrt(sum(p**2 for p in parts) + rotation * parts[1] * parts[2]))


@pytest.mark.parametrize(
    ("one", "other", "expected"),
    [
        ((50, 2.6772, -79.7751), (50, 0, -82.7485), 2.0425),
        ((50, -1, 2), (50, 0, 0), 2.3669),
        ((50, 2.5, 0), (56, -27, -3), 31.9030),
        ((60.2574, -34.0099, 36.2677), (60.4626, -34.1751, 39.4387), 1.2644),
        ((90.8027, -2.0831, 1.4410), (91.1528, -1.6435, 0.0447), 1.4441),
    ],
)
def test_the_distance_is_that_of_its_authors_table(one, other, expected):
    assert distance(np.array(one), np.array(other)) == pytest.approx(expected, abs=1e-4)


@pytest.mark.parametrize("theme", GROUNDS)
@pytest.mark.parametrize("eye", EYES)
def test_any_two_solvers_are_told_apart_by_colour_alone(eye: str, theme: str):
    """All of them, so those that share a figure too."""
    place = ("light", "dark").index(theme)
    colours = {look[place] for look in LOOKS.values()}
    assert len(colours) == len(LOOKS) - 1, "both forms averaged to first order share one"
    seen = {colour: lab(colour, eye) for colour in colours}
    apart = {(a, b): distance(seen[a], seen[b]) for a, b in combinations(colours, 2)}
    assert min(apart.values()) >= LEAST_DISTANCE, min(apart, key=apart.__getitem__)


@pytest.mark.parametrize("theme", GROUNDS)
def test_lines_stand_out_from_their_ground(theme: str):
    place = ("light", "dark").index(theme)
    for name, look in [*LOOKS.items(), ("others", (*OTHER, "X"))]:
        for ground in GROUNDS[theme]:
            assert contrast(look[place], ground) >= LEAST_CONTRAST, name


# Of the page of motions, which are the same in both themes: the axis, the full and the averaged equations.
MOTION = re.findall(
    r'(?:ORANGE|BLUE|PINK) = "(#\w{6})"',
    (Path(site.__file__).with_name("motion.js")).read_text("utf-8"),
)


@pytest.mark.parametrize("eye", EYES)
@pytest.mark.parametrize(
    "colours",
    [[*SLOW_COLOURS.values()], MOTION, SERIES],
    ids=["L and E", "motion", "series"],
)
def test_other_lines_of_a_figure_are_told_apart(colours: Sequence[str], eye: str):
    assert len(colours) >= 3
    seen = [lab(colour, eye) for colour in colours]
    assert min(distance(a, b) for a, b in combinations(seen, 2)) >= LEAST_DISTANCE
    assert all(contrast(colour, "#FFFFFF") >= LEAST_CONTRAST for colour in colours)


def test_lines_of_the_page_of_motions_stand_out_in_the_dark():
    assert all(contrast(colour, "#14181E") >= LEAST_CONTRAST for colour in MOTION)


def test_every_solver_has_a_look():
    assert set(SOLVERS) <= set(LOOKS)
    assert set(LOOKS) <= set(CODES)


def test_words_stand_out():
    for ink in (INK, SOFT):
        assert contrast(ink, "#FFFFFF") >= LEAST_TEXT_CONTRAST
    for light, _, _ in LOOKS.values():
        ink = {"white": "#FFFFFF", "black": "#000000"}[ink_on(light)]
        assert contrast(ink, light) >= LEAST_TEXT_CONTRAST


@pytest.mark.parametrize("count", [2, 3, 4, 5])
def test_an_ordered_ramp_goes_from_light_to_dark(count: int):
    lightness = [lab(colour, "usual")[0] for colour in ramp(count)]
    assert len(set(ramp(count))) == count
    assert lightness == sorted(lightness, reverse=True)


def test_the_site_gets_both_colours():
    light, dark, _ = LOOKS["taylor"]
    assert both_colours("taylor") == f"light-dark({light}, {dark})"


def test_a_figure_is_as_wide_as_a_page_and_its_caption_lies_within(tmp_path):
    figure, grid = panels(1, 2, 2.0)
    grid[0, 0].plot([1, 2], [1, 2])
    words = (
        "Tolerances 0.01 to 1e-14. Times: warm runs, the fastest of up to 5, which vary by 29 %."
    )
    caption(figure, f"{words} {words}")
    figure.canvas.draw()
    box, page = figure.texts[0].get_window_extent(), figure.bbox
    assert page.x0 <= box.x0 <= box.x1 <= page.x1
    lowest = min(axes.get_tightbbox().y0 for axes in grid.flat)
    assert page.y0 <= box.y0 <= box.y1 <= lowest
    save(figure, tmp_path, "picture")
    with Image.open(tmp_path / "picture.png") as image:
        assert image.width == 838
    plt.close(figure)


def test_panes_that_are_not_quite_white_stay_grey():
    """Beside thousands of shades of pink and blue, among which one is nearer to them than white is."""
    generator = np.random.default_rng(2)
    pixels = np.full((200, 200, 3), 255, dtype=np.uint8)
    pixels[:90] = (242, 242, 242)
    pixels[150:, :, 0] = generator.integers(225, 256, size=(50, 200))
    pixels[150:, :, 1] = generator.integers(215, 240, size=(50, 200))
    pixels[150:, :, 2] = generator.integers(225, 256, size=(50, 200))
    drawn = np.asarray(few_colours(Image.fromarray(pixels)).convert("RGB")).astype(int)
    assert np.abs(drawn[:90] - 242).max() <= 3
    assert np.ptp(drawn[:90], axis=2).max() <= 2
    assert (drawn[90:150] == 255).all()


def test_white_stays_white_beside_colours_near_it():
    pixels = np.full((100, 100, 3), 255, dtype=np.uint8)
    pixels[:20] = (250, 252, 251)
    pixels[20:30] = (238, 244, 241)
    pixels[30:34, :50] = (79, 144, 145)
    drawn = np.asarray(few_colours(Image.fromarray(pixels)).convert("RGB"))
    assert (drawn[34:] == 255).all()
    assert (drawn[30:34, :50] == (79, 144, 145)).all()


def test_letters_are_nine_pixels_on_a_phone():
    """At 390 pixels in width."""
    assert style.LETTERS / 72 * style.DPI * 390 / 838 >= 9


def test_where_a_page_was_measured_is_read_from_it():
    lines = ["Made by `polhode bench`.", "Measured on 2026-11-24 on A CPU, 2 cores, Linux, Python."]
    assert measured(lines) == "A CPU, 2 cores"
    assert measured(["Measured from 2026-11-22 to 2026-11-24 on B, 16 cores, x."]) == "B, 16 cores"
    assert measured(["Nothing."]) == ""


def test_every_solver_has_a_marker_of_its_own_everywhere():
    assert len({look.marker for look in looks(SOLVERS).values()}) == len(SOLVERS)
    markers = {LOOKS[name][2] for name in SOLVERS if name in LOOKS}
    assert not markers & {"*", "X", "x"}, (
        "stars are averaged forms, crosses solvers without a look of their own"
    )


def test_others_get_markers_in_turn_and_stand_last():
    found = looks(["own:B", "own:A", "exact", "taylor"])
    assert list(found) == ["taylor", "exact", "own:A", "own:B"]
    assert found["own:A"].colour == found["own:B"].colour == OTHER[0]
    assert found["own:A"].marker != found["own:B"].marker
    assert rank("taylor") < rank("quaternion") < rank("own:A")


@pytest.mark.parametrize("name", ["taylor", "cyrk-lsoda", "radau", "averaged"])
def test_outlines_are_closed_paths_about_the_centre(name: str):
    outline = looks([name])[name].outline
    assert outline.startswith("M")
    assert outline.endswith("Z")
    numbers = [float(word) for word in outline.translate(str.maketrans("MLCZ", "    ")).split()]
    assert 0.8 < max(map(abs, numbers)) < 1.5
