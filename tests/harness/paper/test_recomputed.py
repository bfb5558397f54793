"""Numbers of twenty items, drawn by lot, against their recomputation from the vector equation.

`tests/oracle/paper_items/recompute.py` computed them, without the project; the lot is in its first lines. Of the items
that it leaves out `averages-ellipsoid` is recomputed by `tests/models/misprints/test_averages.py`.
"""

import json
import random
from math import floor, log10
from pathlib import Path

import pytest

from polhode.harness.paper import store
from polhode.harness.paper.claims import find_items, items, section_of

ROOT = Path(__file__).parents[3]
NUMBERS = json.loads(
    (ROOT / "tests" / "oracle" / "paper_items" / "numbers.json").read_text(encoding="utf-8")
)
ELSEWHERE = ("averages-ellipsoid",)
# Digits that the pages write.
DIGITS = 4
# Numbers that are errors of a method, or rounding: both must lie below what is said here.
SMALL = {
    "exponent in St below St = 0.01, off 1, worst κ": 1e-7,
    "the rate against a run in time, St = 0.02, relative, worst κ": 1e-5,
    "largest |L_x| or |L_y| that starts at zero": 1e-14,
}
# Chaotic orbits follow rounding: medians of finite exponents, and which of some hundred slow ones
# shows its chaos in time.
CHAOTIC = {
    "share of chaotic orbits, starts uniform on SO(3)": 3e-3,
    "the same of starts on the section: φ = 0, cos θ and ψ uniform": 0.03,
    "median exponent of the chaotic orbits, per half turn": 0.02,
    "median exponent of the regular orbits, per half turn": 0.005,
}
# The rate that is printed comes from differences of 1e-6 there: three digits of what it leaves.
COARSE = {"measured over printed rate, less one, worst of 20": 1e-6}


def verdict_of(name):
    (item,) = find_items((name,))
    found = store.judged(ROOT / "reports" / "paper" / section_of(item).name, item)
    if isinstance(found, str):
        pytest.skip(f"{name}: {found}")
    return found[1]


def test_the_lot_is_complete():
    drawn = random.Random(20261126).sample([item.name for item in items()], 20)
    assert sorted(drawn) == sorted([*NUMBERS, *ELSEWHERE])


@pytest.mark.parametrize("name", NUMBERS)
def test_each_number_is_right_to_the_digits_that_are_written(name):
    compared = 0
    for number in verdict_of(name).numbers:
        if number.what not in NUMBERS[name]:
            continue
        compared += 1
        expected = NUMBERS[name][number.what]
        if number.what in SMALL:
            assert max(abs(number.value), abs(expected)) < SMALL[number.what], number.what
            continue
        # One unit of the last digit that is written.
        unit = 10.0 ** (floor(log10(abs(number.value))) - DIGITS + 1) if number.value else 1e-12
        within = {**CHAOTIC, **COARSE}.get(number.what, unit)
        assert number.value == pytest.approx(expected, rel=0, abs=within), number.what
    assert compared >= 2


@pytest.mark.parametrize("name", [name for name in NUMBERS if name.startswith("poincare")])
def test_nearly_all_orbits_are_judged_alike(name):
    assert NUMBERS[name]["orbits that are judged otherwise"] <= 5e-3 * NUMBERS[name]["orbits"]
