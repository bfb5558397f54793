from time import sleep

import pytest

from polhode.models.spent import SPENT, spent_on


def test_a_moment_counts_for_the_innermost_piece_of_work():
    before = dict(SPENT)
    with spent_on("outer"):
        sleep(0.02)
        with spent_on("inner"):
            sleep(0.05)
    assert SPENT.pop("inner") == pytest.approx(0.05, abs=0.02)
    assert SPENT.pop("outer") == pytest.approx(0.02, abs=0.02)
    assert before == SPENT
