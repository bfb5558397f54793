"""Numbers and tables as people read them."""

from math import nan

import pytest

from polhode.harness.common.text import (
    WORDING,
    aligned,
    duration,
    in_full,
    in_two_digits,
    markdown,
    scientific,
    short,
)


def test_aligned():
    assert aligned(["a", "long"], [["xyz", 1], ["", None]]) == "a    long\nxyz  1\n     None"


def test_aligned_without_rows():
    assert aligned(["a", "b"], []) == "a  b"


def test_markdown():
    expected = "| a   | number |\n| --- | -----: |\n| x   |    1.5 |\n"
    assert markdown(["a", "number"], [["x", 1.5]], right=[1]) == expected


def test_markdown_without_rows():
    assert markdown(["a"], []) == "| a   |\n| --- |\n"


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (1.26e-7, "1.3e-7"),
        (float("inf"), "inf"),
        (1.0, "1.0e0"),
        (9.96e-10, "1.0e-9"),
        (0.0, "0.0e0"),
        (-2.5e12, "-2.5e12"),
        (None, "–"),
        (float("nan"), "–"),
    ],
)
def test_scientific(value: float | None, text: str):
    assert scientific(value) == text


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (63.4, "63 s"),
        (9.96, "10 s"),
        (9.94, "9.9 s"),
        (1.4034e12, "1.4e12 s"),
        (99_000.0, "99000 s"),
        (1.0, "1.0 s"),
        (0.0123, "12 ms"),
        (1e-3, "1.0 ms"),
        (0.0009, "900 µs"),
        (2.5e-6, "2.5 µs"),
        (2e-9, "2.0 ns"),
        (0.0, "0 s"),
        (None, "–"),
        (float("nan"), "–"),
    ],
)
def test_duration(seconds: float | None, text: str):
    assert duration(seconds) == text


@pytest.mark.parametrize(
    ("value", "six", "full", "two"),
    [
        (1e-4, "1e-4", "1e-4", "1e-4"),
        (1e-3, "0.001", "0.001", "0.001"),
        (0.1 + 0.2, "0.3", "0.30000000000000004", "0.3"),
        (5932.0, "5932", "5932", "5900"),
        (99999, "99999", "99999", "1e5"),
        (1e5, "1e5", "1e5", "1e5"),
        (1e8, "1e8", "1e8", "1e8"),
        (1000.0, "1000", "1000", "1000"),
        (2.5e-7, "2.5e-7", "2.5e-7", "2.5e-7"),
        (7e-13, "7e-13", "7e-13", "7e-13"),
        (-1.2345e-6, "-1.2345e-6", "-1.2345e-6", "-1.2e-6"),
        (0.0, "0", "0", "0"),
        (float("inf"), "inf", "inf", "inf"),
    ],
)
def test_one_convention_for_numbers(value: float, six: str, full: str, two: str):
    assert (short(value), in_full(value), in_two_digits(value)) == (six, full, two)


def test_a_field_without_a_value_is_a_dash():
    assert (
        WORDING.format("{a:.2f} {a:two} {b:.1f} {c:short}", a=nan, b=1.25, c=[nan, 1e-6])
        == "– – 1.2 –, 1e-6"
    )
