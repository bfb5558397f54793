"""The tables of averages: nothing is left out, and what an entry says is what it averages."""

import numpy as np
import pytest

from polhode.harness.paper.sections.appendix_entries import ellipsoid_entries, spheroid_entries


def test_every_printed_entry_is_there_once():
    """Counted in the paper: 18 and 27 in axes along L, 6 mixed, 12 and 18 in space axes, and 5 general formulas."""
    names = [entry.name for entry in ellipsoid_entries()]
    general = [name for name in names if name.startswith("general")]
    assert len(names) == len(set(names))
    assert (len(names) - len(general), len(general)) == (18 + 27 + 6 + 12 + 18, 5)
    assert len(spheroid_entries()) == 8


def test_words_are_the_products_they_name():
    generator = np.random.default_rng(1)
    t, u = generator.normal(size=(2, 5, 3, 3))
    entries = {entry.name: entry for entry in ellipsoid_entries()}
    assert entries["⟨z1 x'2 y'3⟩"].mean(t, u) == pytest.approx(
        np.mean(u[:, 0, 2] * t[:, 1, 0] * t[:, 2, 1])
    )


def test_a_wrong_formula_shows():
    """Means over one rotation are no averages: entries that hold for the Euler top fail."""
    t = np.eye(3)[None]
    entries = {entry.name: entry for entry in ellipsoid_entries()}
    printed, corrected = entries["⟨x1 x1⟩"].deviations(t, t, np.array([0.0, 0.0, 1.0]), np.zeros(3))
    assert printed == corrected == pytest.approx(0.5)
