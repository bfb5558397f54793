"""The two verdicts on a printed formula."""

import numpy as np


def assert_misprint(printed, corrected, truth, *, tolerance=1e-11, gap=1e-2):
    """The corrected value agrees with first principles within `tolerance`, the printed one misses them by over `gap`.

    Both are relative to the largest entry of `truth` (or to one, if that is smaller). The defaults are estimates:
    rounding and quadratures stay far below the one, misprints that are known far above the other.
    """
    assert_right(corrected, truth, tolerance=tolerance)
    assert deviation(printed, truth) > gap


def assert_right(claimed, truth, *, tolerance=1e-11):
    """The claimed value agrees with first principles within `tolerance`."""
    assert deviation(claimed, truth) < tolerance


def deviation(claimed, truth):
    """Largest difference over the largest entry of `truth`, or over one; NaN counts as infinite."""
    claimed, truth = np.asarray(claimed), np.asarray(truth)
    worst = np.max(np.abs(claimed - truth)) / max(1.0, np.max(np.abs(truth)))
    return np.inf if np.isnan(worst) else worst
