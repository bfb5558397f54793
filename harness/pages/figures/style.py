"""The look of every solver and averaged form, the same in figures and on the site; pictures in few colours."""

import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import cycle
from math import floor, inf, log10
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.markers import MarkerStyle
from PIL import Image

from polhode.models.catalogue import FORMS, form as find_form
from polhode.solvers.catalogue import SOLVERS

GREY = "#C4C4C4"
LOOKS: dict[str, tuple[str, Any]] = {
    name: (colour, tuple(marker) if isinstance(marker, list) else marker)
    for name, (colour, marker) in tomllib.loads(
        Path(__file__).with_name("looks.toml").read_text("utf-8")
    ).items()
}
# Solvers and forms without a look of their own share a colour, and take these markers in turn. Some
# are outside the catalogue.
OTHER = "#6B3F1D"
_OTHER_MARKERS = ("X", (5, 1, 180), (3, 1, 0), (7, 1, 0))
# More colours, or nearer ones, only make a picture larger.
_COLOURS = 128  # Colours of a picture at most.
_LEAST_DIFFERENCE = 16  # Of 255: the difference of two colours in red, green or blue.


@dataclass(frozen=True)
class Look:
    """A colour and a marker of Matplotlib."""

    colour: str
    marker: Any

    @property
    def outline(self) -> str:
        """The marker as an SVG path, y downwards, of about unit size."""
        style = MarkerStyle(self.marker)
        path = style.get_path().transformed(style.get_transform())
        parts = []
        for values, code in path.iter_segments():
            points = " ".join(f"{value:.2f}" for value in (values.reshape(-1, 2) * (2, -2)).ravel())
            parts.append({1: f"M{points}", 2: f"L{points}", 4: f"C{points}"}.get(int(code), "Z"))
        return "".join(parts)


def looks(names: Iterable[str]) -> dict[str, Look]:
    """Looks of solvers and averaged forms, in the order of `rank`."""
    ordered = sorted(set(names), key=rank)
    markers = cycle(_OTHER_MARKERS)
    return {
        name: Look(*LOOKS[name]) if name in LOOKS else Look(OTHER, next(markers))
        for name in ordered
    }


def colour(name: str) -> str:
    """Colour of a solver or an averaged form."""
    return LOOKS[name][0] if name in LOOKS else OTHER


def rank(name: str) -> tuple[int, str]:
    """Key to sort solvers and forms: solvers first, then forms, each in the order of its catalogue."""
    catalogue = [*SOLVERS, *FORMS]
    return (catalogue.index(name) if name in catalogue else len(catalogue)), name


def is_averaged(form: str) -> bool:
    """Whether a form, which may have no name, is averaged."""
    return bool(form) and find_form(form).averaged


def power(value: float) -> str:
    """A number for a figure: from 1000 on and below 0.01 with its power of ten, others as they are."""
    exponent = floor(log10(value) + 1e-12) if 0 < value < inf else 0
    if -3 < exponent < 3:
        return f"{value:g}"
    factor = f"{value / 10.0**exponent:.3g}"
    return f"$10^{{{exponent}}}$" if factor == "1" else f"${factor}\\times10^{{{exponent}}}$"


def few_colours(image: Image.Image) -> Image.Image:
    """An RGB picture in the colours that most of it has: lines keep theirs, which a mean of areas would shift."""
    counted: Any = image.getcolors(image.width * image.height)
    left = np.array([colour for _, colour in sorted(counted, reverse=True)])
    chosen = []
    while len(left) and len(chosen) < _COLOURS:
        chosen.append(left[0])
        left = left[np.max(np.abs(left - left[0]), axis=1) >= _LEAST_DIFFERENCE]
    palette = Image.new("P", (1, 1))
    palette.putpalette(np.resize(chosen, (256, 3)).astype(np.uint8).tobytes())
    return image.quantize(palette=palette, dither=Image.Dither.NONE)
