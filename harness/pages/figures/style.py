"""The look of every solver and averaged form: colour, marker and rank, the same in figures and on the site."""

from collections.abc import Iterable
from dataclasses import dataclass
from math import floor, inf, log10
from typing import Any

import numpy as np
from matplotlib.markers import MarkerStyle
from PIL import Image

from polhode.models.catalogue import FORMS, form as find_form
from polhode.solvers.catalogue import SOLVERS

GREY = "#C4C4C4"
# Okabe and Ito's hues: orange and brown for implicit methods, green and blue for explicit ones, purple for averaged
# forms, muted tones for SciPy; wine and violets for solvers that know St. Within a hue the lightness differs,
# so that the regime map, which has no markers, holds in grey and for colour-blind readers. Markers are Matplotlib's.
LOOKS: dict[str, tuple[str, Any]] = {
    "taylor": ("#0FBA89", "o"),
    "dop853": ("#5B6FA8", "<"),
    "rk45": ("#97A3C4", ">"),
    "radau": ("#8C7A3A", (4, 1, 0)),
    "bdf": ("#C9B98F", (5, 0, 180)),
    "lsoda": ("#7E5A3C", "p"),
    "cvode-adams": ("#6FE4BA", "8"),
    "cvode-bdf": ("#A8803C", (4, 1, 45)),
    "ida": ("#6D2B06", (6, 1, 0)),
    "cyrk-vern8": ("#01559B", "s"),
    "cyrk-vern7": ("#1482C6", "D"),
    "cyrk-dop853": ("#68A9CE", "^"),
    "cyrk-tsit5": ("#99D1FE", "v"),
    "cyrk-lsoda": ("#AE4202", "P"),
    "cyrk-bdf": ("#DDCC67", "d"),
    "cyrk-radau": ("#EB9406", "h"),
    "splitting": ("#550033", (3, 0, 0)),
    "splitting-extended": ("#220077", (3, 0, 180)),
    "stroboscopic": ("#8833FF", (8, 1, 0)),
    "exact": ("#8C8C8C", "H"),
    "averaged": ("#B46086", "*"),
    "averaged-spheroid": ("#B46086", "*"),
    "averaged-second-order": ("#7B2A67", "*"),
}
# Solvers and forms without a look of their own, those outside the catalogue among them: markers in turn.
OTHER, OTHER_MARKERS = "#6B3F1D", ("X", (5, 1, 180), (3, 1, 0), (7, 1, 0))

# Of a picture, and how far apart, of 255: more and nearer ones only weigh.
COLOURS, APART = 128, 16


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
    found, others = {}, 0
    for name in sorted(set(names), key=rank):
        if name in LOOKS:
            found[name] = Look(*LOOKS[name])
        else:
            found[name] = Look(OTHER, OTHER_MARKERS[others % len(OTHER_MARKERS)])
            others += 1
    return found


def colour(name: str) -> str:
    """Colour of a solver or an averaged form."""
    return LOOKS[name][0] if name in LOOKS else OTHER


def rank(name: str) -> tuple[int, str]:
    """Where a solver or form stands among others: solvers, then forms, each in the order of its catalogue."""
    known = [*SOLVERS, *FORMS]
    return (known.index(name) if name in known else len(known)), name


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
    left, chosen = np.array([colour for _, colour in sorted(counted, reverse=True)]), []
    while len(left) and len(chosen) < COLOURS:
        chosen.append(left[0])
        left = left[np.max(np.abs(left - left[0]), axis=1) >= APART]
    palette = Image.new("P", (1, 1))
    palette.putpalette(np.resize(chosen, (256, 3)).astype(np.uint8).tobytes())
    return image.quantize(palette=palette, dither=Image.Dither.NONE)
