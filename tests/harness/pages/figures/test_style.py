"""One look for every solver, told apart by all eyes."""

from itertools import combinations

import numpy as np
import pytest

from polhode.harness.analysis.pareto import Method
from polhode.harness.pages.figures.style import LOOKS, OTHER, colour, looks, rank
from polhode.harness.studies.study import read_study
from polhode.solvers.catalogue import SOLVERS

# Linear sRGB as a protanope and a deuteranope see it (Machado, Oliveira and Fernandes 2009,
# severity 1).
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
}
# Linear sRGB to cones, and the cones' cube roots to Oklab, in which distances are those that the
# eye sees.
CONES = [
    [0.4122214708, 0.5363325363, 0.0514459929],
    [0.2119034982, 0.6806995451, 0.1073969566],
    [0.0883024619, 0.2817188376, 0.6299787005],
]
OKLAB = [
    [0.2104542553, 0.7936177850, -0.0040720468],
    [1.9779984951, -2.4285922050, 0.4505937099],
    [0.0259040371, 0.7827717662, -0.8086757660],
]
# Black and white are 1 apart; cyrk-vern8 and averaged-second-order were 0.02 apart once.
LEAST = 0.09


def seen(colour: str, eye: str) -> np.ndarray:
    """A colour in Oklab, as an eye sees it."""
    values = np.array([int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)])
    linear = np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)
    return np.array(OKLAB) @ np.cbrt(np.array(CONES) @ np.clip(np.array(EYES[eye]) @ linear, 0, 1))


@pytest.mark.parametrize("eye", EYES)
def test_methods_of_the_map_are_told_apart_by_colour_alone(eye: str):
    study = read_study(None, "regimes")
    labels = {Method(form, solver).label for form in study.forms for solver in study.solvers}
    labels |= {"cvode-adams", "ida", "cyrk-vern7"}
    colours = {colour(label) for label in labels}
    assert len(colours) == len(labels) - 1, "both forms averaged to first order share one"
    assert (
        min(np.linalg.norm(seen(a, eye) - seen(b, eye)) for a, b in combinations(colours, 2))
        > LEAST
    )


def test_every_solver_has_a_marker_of_its_own_everywhere():
    assert len({look.marker for look in looks(SOLVERS).values()}) == len(SOLVERS)
    markers = {LOOKS[name][1] for name in SOLVERS if name in LOOKS}
    assert not markers & {"*", "X", "x"}, (
        "stars are averaged forms, crosses solvers without a look of their own"
    )


def test_others_get_markers_in_turn_and_stand_last():
    found = looks(["own:B", "own:A", "exact", "taylor"])
    assert list(found) == ["taylor", "exact", "own:A", "own:B"]
    assert found["own:A"].colour == found["own:B"].colour == OTHER
    assert found["own:A"].marker != found["own:B"].marker
    assert rank("taylor") < rank("quaternion") < rank("own:A")


@pytest.mark.parametrize("name", ["taylor", "cyrk-lsoda", "radau", "averaged"])
def test_outlines_are_closed_paths_about_the_centre(name: str):
    outline = looks([name])[name].outline
    assert outline.startswith("M")
    assert outline.endswith("Z")
    numbers = [float(word) for word in outline.translate(str.maketrans("MLCZ", "    ")).split()]
    assert 0.8 < max(map(abs, numbers)) < 1.5
