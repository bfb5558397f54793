"""What the statistics of an ensemble say: means with standard errors, fractions and quantiles with intervals."""

from dataclasses import dataclass
from itertools import product
from math import ceil
from typing import Any

import numpy as np
from scipy.special import bdtrik

from polhode.harness.common.fits import COVERAGE, wilson
from polhode.harness.ensembles.ensemble import Ensemble
from polhode.harness.ensembles.statistics import FOURTH, FOURTH_OF_VOIGT, RATES, SECOND, SLOW_NAMES, VOIGT, Statistics

QUANTILES = (0.1, 0.5, 0.9)


@dataclass(frozen=True)
class Estimate:
    """A value with the ends of its 95 % confidence interval; None is beyond the end of the run."""

    value: float | None
    low: float | None
    high: float | None


def second_moments(statistics: Statistics) -> tuple[np.ndarray, np.ndarray]:
    """⟨p_i p_j⟩ and standard errors, both of shape (snapshots, axes, 6), in the order of `SECOND`.

    The variance needs ⟨p_i² p_j²⟩, which is a fourth moment.
    """
    squares = [FOURTH.index(tuple(sorted((*pair, *pair)))) for pair in SECOND]
    return _means(statistics.finished, statistics.second, statistics.fourth[:, :, squares])


def fourth_moments(statistics: Statistics) -> tuple[np.ndarray, np.ndarray]:
    """⟨p_i p_j p_k p_l⟩ and standard errors, both of shape (snapshots, axes, 15), in the order of `FOURTH`."""
    return _means(statistics.finished, statistics.fourth, statistics.fourth_squares)


def fourth_in_voigt_order(statistics: Statistics) -> tuple[np.ndarray, np.ndarray]:
    """⟨p_i p_j p_k p_l⟩ and standard errors as matrices in Voigt's order xx, yy, zz, yz, xz, xy.

    Both of shape (snapshots, axes, 6, 6), as tensors of stiffness are written: no factors stand before the components
    (Voigt 1910; of orientation: Advani and Tucker, J. Rheol. 31 (1987) 751).
    """
    mean, error = fourth_moments(statistics)
    return mean[..., FOURTH_OF_VOIGT], error[..., FOURTH_OF_VOIGT]


def rate_means(statistics: Statistics) -> tuple[np.ndarray, np.ndarray]:
    """⟨(ω·p)²⟩ and ⟨|dp/dt|²⟩ and standard errors, both of shape (snapshots, axes, 2), in the order of `RATES`."""
    return _means(statistics.finished, statistics.rates, statistics.rates_squares)


def slow_means(statistics: Statistics) -> tuple[np.ndarray, np.ndarray]:
    """Means of `SLOW_NAMES` over the largest moment of inertia and standard errors, both of shape (snapshots, 5)."""
    return _means(statistics.finished, statistics.slow, statistics.slow_squares)


def _means(count: int, sums: np.ndarray, squares: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    if count == 0:
        return np.full_like(sums, np.nan), np.full_like(sums, np.nan)
    mean = sums / count
    variance = np.maximum(squares / count - mean**2, 0)
    return mean, np.sqrt(variance / max(count - 1, 1))


def fraction(count: int, of: int) -> Estimate:
    """A fraction with its interval."""
    return Estimate(count / of, *wilson(count, of)) if of else Estimate(None, 0.0, 1.0)


def arrived(statistics: Statistics, attractor: int) -> list[Estimate]:
    """Fraction of the finished particles that have come to an attractor for good, at each sample."""
    counts = np.cumsum(statistics.arrivals[attractor])
    return [fraction(int(count), statistics.finished) for count in counts]


def transient_quantile(ensemble: Ensemble, statistics: Statistics, share: float) -> Estimate:
    """Quantile of the time, in units of the inverse shear rate, after which a particle has arrived anywhere.

    Without assumption on the distribution: the interval lies between the order statistics whose ranks bound a
    binomial variable (Conover, Practical Nonparametric Statistics, section 3.2). Particles that have not arrived by
    the end count as later; times are known to one sample, and rounded up.
    """
    n = statistics.finished
    reached = np.cumsum(np.sum(statistics.arrivals, axis=0))
    times = np.linspace(0.0, ensemble.time, ensemble.samples)

    def order_statistic(rank: int) -> float | None:
        place = int(np.searchsorted(reached, rank))
        return float(times[place]) if rank <= n and place < len(times) else None

    if n == 0 or len(reached) == 0:
        return Estimate(None, None, None)
    tail = (1 - COVERAGE) / 2
    low, high = ceil(bdtrik(tail, n, share)), ceil(bdtrik(1 - tail, n, share)) + 1
    return Estimate(
        order_statistic(max(1, round(share * n))), order_statistic(low) if low > 0 else 0.0, order_statistic(high)
    )


def _axes(ensemble: Ensemble) -> dict[str, list[Any]]:
    return {"time": snapshot_times(ensemble), "body_axis": [axis + 1 for axis in ensemble.layout.axes]}


def moment_rows(ensemble: Ensemble, statistics: Statistics) -> list[dict[str, object]]:
    """Orientation moments, one row per snapshot, body axis and component."""
    axes = _axes(ensemble)
    moments = ((SECOND, second_moments(statistics)), (FOURTH, fourth_moments(statistics)))
    names = [["".join("xyz"[i] for i in component) for component in order] for order, _ in moments]
    return [
        row
        for (_, means), components in zip(moments, names, strict=True)
        for row in _mean_rows(ensemble, {**axes, "moment": components}, *means)
    ]


def voigt_rows(ensemble: Ensemble, statistics: Statistics) -> list[dict[str, object]]:
    """Fourth moments as matrices in Voigt's order, one row per snapshot, body axis and entry from the diagonal on."""
    names = ["".join("xyz"[i] for i in pair) for pair in VOIGT]
    axes = {**_axes(ensemble), "row": names, "column": names}
    rows = _mean_rows(ensemble, axes, *fourth_in_voigt_order(statistics))
    return [row for row in rows if names.index(str(row["row"])) <= names.index(str(row["column"]))]


def rate_rows(ensemble: Ensemble, statistics: Statistics) -> list[dict[str, object]]:
    """Mean squares of spinning and tumbling rates, one row per snapshot, body axis and rate."""
    return _mean_rows(ensemble, {**_axes(ensemble), "rate": list(RATES)}, *rate_means(statistics))


def slow_rows(ensemble: Ensemble, statistics: Statistics) -> list[dict[str, object]]:
    """Means of the slow variables, one row per snapshot and variable."""
    variables = [f"{name}/Imax" for name in SLOW_NAMES]
    return _mean_rows(ensemble, {"time": snapshot_times(ensemble), "variable": variables}, *slow_means(statistics))


def _mean_rows(
    ensemble: Ensemble, axes: dict[str, list[Any]], mean: np.ndarray, error: np.ndarray
) -> list[dict[str, object]]:
    """One row for each place in the arrays, whose axes are named with their values."""
    values = zip(product(*axes.values()), mean.ravel().tolist(), error.ravel().tolist(), strict=True)
    return [
        {**ensemble_columns(ensemble), **dict(zip(axes, place, strict=True)), "mean": one, "standard_error": other}
        for place, one, other in values
    ]


def distribution_rows(ensemble: Ensemble, statistics: Statistics) -> list[dict[str, object]]:
    """Histograms of the slow variables, one row per bin that is not empty; the outermost bins are open."""
    rows = []
    for k, name in enumerate(SLOW_NAMES):
        edges = [-np.inf, *ensemble.layout.edges(name).tolist(), np.inf]
        for s, time in enumerate(snapshot_times(ensemble)):
            counts = statistics.histograms[s, k]
            columns = {**ensemble_columns(ensemble), "time": time, "variable": f"{name}/Imax"}
            rows += [
                {**columns, "low": edges[place], "high": edges[place + 1], "particles": int(counts[place])}
                for place in np.flatnonzero(counts).tolist()
            ]
    return rows


def arrival_rows(ensemble: Ensemble, statistics: Statistics) -> list[dict[str, object]]:
    """Fraction arrived at each attractor, one row per sample."""
    times = np.linspace(0.0, ensemble.time, ensemble.samples).tolist()
    return [
        {
            **ensemble_columns(ensemble),
            "attractor": attractor.rotation,
            "time": time,
            "fraction": interval.value,
            "low": interval.low,
            "high": interval.high,
        }
        for k, attractor in enumerate(ensemble.attractors)
        for time, interval in zip(times, arrived(statistics, k), strict=True)
    ]


def ensemble_row(ensemble: Ensemble, statistics: Statistics) -> dict[str, object]:
    """The ensemble in one row: counts, the fraction arrived at each attractor, quantiles of the transient time."""
    row: dict[str, object] = {
        **ensemble_columns(ensemble),
        "form": ensemble.form,
        "tolerance": ensemble.tolerance,
        "duration": ensemble.time,
        "slow_time": ensemble.slow_time,
        "particles": statistics.particles,
        "failures": statistics.failures,
    }
    ends = {attractor.rotation: arrived(statistics, k)[-1] for k, attractor in enumerate(ensemble.attractors)}
    row["arrived"] = {name: vars(interval) for name, interval in ends.items()}
    row["transient_time"] = {
        f"{share:g}": vars(transient_quantile(ensemble, statistics, share)) for share in QUANTILES if ends
    }
    row["method"] = ensemble.method
    return row


def ensemble_columns(ensemble: Ensemble) -> dict[str, object]:
    """Columns that tell ensembles apart."""
    a, b, c = ensemble.ellipsoid.semi_axes
    return {"a": a, "b": b, "c": c, "stokes": ensemble.stokes, "equations": ensemble.equations}


def snapshot_times(ensemble: Ensemble) -> list[float]:
    """Times of the snapshots in units of the inverse shear rate."""
    return np.linspace(0.0, ensemble.time, ensemble.snapshots).tolist()
