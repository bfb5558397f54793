"""Numbers of twenty items, drawn by lot, against their recomputation from the vector equation.

`tests/oracle/paper_items/recompute.py` computed them, without the project; the lot is in its first lines. Of the items
that it leaves out `averages-ellipsoid` is recomputed by `tests/models/misprints/test_averages.py`.
"""

import json
import random
from pathlib import Path

import pytest

from polhode.harness.paper import store
from polhode.harness.paper.claims import find_items, items, section_of
from polhode.harness.paper.pages import last_unit

ROOT = Path(__file__).parents[3]
NUMBERS = json.loads(
    (ROOT / "tests" / "oracle" / "paper_items" / "numbers.json").read_text(encoding="utf-8")
)
ELSEWHERE = ("averages-ellipsoid",)


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
    for number in verdict_of(name).numbers:
        expected = NUMBERS[name][number.name]
        if abs(number.value) < number.floor:
            assert abs(expected) < number.floor, number.name
            continue
        within = last_unit(number)
        assert number.value == pytest.approx(expected, rel=0, abs=within), number.name


@pytest.mark.parametrize("name", [name for name in NUMBERS if name.startswith("poincare")])
def test_nearly_all_orbits_are_judged_alike(name):
    assert NUMBERS[name]["orbits that are judged otherwise"] <= 5e-3 * NUMBERS[name]["orbits"]
