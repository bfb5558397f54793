"""A short seeded part of `make torture`; kills of each command are tested beside the command."""

from pathlib import Path
from random import Random

import numpy as np
import pytest

from polhode.models.files import cached
from torture.flips import flipped
from torture.fuzz import fuzzed, mutated, warm


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("POLHODE_CACHE", str(tmp_path / "cache"))
    # As in a whole run of the torture, where other parts have kept numbers before.
    cached.save("another", np.arange(3.0))


def test_no_flipped_bit_is_used_as_good(capsys):
    assert flipped(20, 140) == []


def test_a_file_whose_sum_is_not_kept_would_be_noticed(monkeypatch: pytest.MonkeyPatch, capsys):
    monkeypatch.setattr("polhode.harness.common.files._sums", lambda folder: {})
    assert flipped(20, 140)


def test_hostile_input_is_answered_in_a_line(tmp_path: Path):
    warm()
    assert fuzzed(21, 12, tmp_path) == []


def test_input_is_spoiled_in_many_ways():
    assert len({mutated("a = 1\n[b]\nc = 2.5\n", Random(seed)) for seed in range(100)}) > 60
