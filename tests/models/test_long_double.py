"""Long double of 80 bits is told from double and from IEEE's quadruple."""

import importlib
from types import SimpleNamespace

import numpy as np
import pytest

from polhode.models import long_double
from polhode.solvers import taylor
from polhode.solvers.catalogue import solver


@pytest.fixture
def pretend(monkeypatch: pytest.MonkeyPatch):
    """A machine whose long double has so many bits of fraction."""

    def with_bits(bits: int) -> None:
        monkeypatch.setattr(np, "finfo", lambda kind: SimpleNamespace(nmant=bits))
        importlib.reload(long_double)

    yield with_bits
    monkeypatch.undo()
    importlib.reload(long_double)


@pytest.mark.parametrize(("bits", "is_x86"), [(52, False), (63, True), (112, False)])
def test_extended_precision_is_x86s_alone(bits: int, is_x86: bool, pretend):
    pretend(bits)
    assert is_x86 == long_double.IS_X86
    assert taylor.extends_precision() is is_x86
    missing = "x86's long double of 80 bits is missing, on this machine or in NumPy"
    assert solver("splitting-extended").why_not == (None if is_x86 else missing)
