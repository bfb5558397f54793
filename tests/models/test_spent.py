import pytest

from polhode.models.spent import SPENT, spent_on


def test_a_moment_counts_for_the_innermost_piece_of_work(monkeypatch: pytest.MonkeyPatch):
    seconds, now = SPENT.seconds, [0.0]
    before = dict(seconds)
    monkeypatch.setattr("polhode.models.spent.perf_counter", lambda: now[0])
    with spent_on("outer"):
        now[0] += 0.02
        with spent_on("inner"):
            now[0] += 0.05
    assert seconds.pop("inner") == pytest.approx(0.05)
    assert seconds.pop("outer") == pytest.approx(0.02)
    assert before == seconds
