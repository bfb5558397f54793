"""What the statistics of an ensemble say: means with standard errors, fractions and quantiles with intervals."""

from dataclasses import dataclass
from math import sqrt

import numpy as np

from polhode.harness.ensembles.ensemble import Ensemble
from polhode.harness.ensembles.statistics import FOURTH, SECOND, SLOW_NAMES, Statistics

# Two-sided coverage of every interval here, and the normal distribution's quantile that belongs to it.
CONFIDENCE, NORMAL_QUANTILE = 0.95, 1.959963984540054
QUANTILES = (0.1, 0.5, 0.9)


@dataclass(frozen=True)
class Interval:
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


def slow_means(statistics: Statistics) -> tuple[np.ndarray, np.ndarray]:
    """Means of `SLOW_NAMES` over the largest moment of inertia and standard errors, both of shape (snapshots, 5)."""
    return _means(statistics.finished, statistics.slow, statistics.slow_squares)


def _means(count: int, sums: np.ndarray, squares: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    if count == 0:
        return np.full_like(sums, np.nan), np.full_like(sums, np.nan)
    mean = sums / count
    variance = np.maximum(squares / count - mean**2, 0)
    return mean, np.sqrt(variance / max(count - 1, 1))


def fraction(count: int, of: int) -> Interval:
    """A fraction with Wilson's score interval (Wilson, J. Am. Stat. Assoc. 22 (1927) 209), which holds at 0 and 1."""
    if of == 0:
        return Interval(None, 0.0, 1.0)
    share, z2 = count / of, NORMAL_QUANTILE**2
    middle = (share + z2 / (2 * of)) / (1 + z2 / of)
    half = NORMAL_QUANTILE / (1 + z2 / of) * sqrt(share * (1 - share) / of + z2 / (4 * of * of))
    low, high = middle - half, middle + half
    return Interval(share, low if count > 0 else 0.0, high if count < of else 1.0)


def arrived(statistics: Statistics, attractor: int) -> list[Interval]:
    """Fraction of the finished particles that have come to an attractor for good, at each sample."""
    counts = np.cumsum(statistics.arrivals[attractor])
    return [fraction(int(count), statistics.finished) for count in counts]


def transient_quantile(ensemble: Ensemble, statistics: Statistics, share: float) -> Interval:
    """Quantile of the time, in units of the inverse shear rate, after which a particle has arrived anywhere.

    Without assumption on the distribution: the interval lies between the order statistics whose ranks bound a
    binomial variable (Conover, Practical Nonparametric Statistics, section 3.2). Particles that have not arrived by
    the end count as later; times are known to one sample, and rounded up.
    """
    from scipy.stats import binom

    n = statistics.finished
    reached = np.cumsum(np.sum(statistics.arrivals, axis=0))
    times = np.linspace(0.0, ensemble.time, ensemble.samples)

    def order_statistic(rank: int) -> float | None:
        place = int(np.searchsorted(reached, rank))
        return float(times[place]) if rank <= n and place < len(times) else None

    if n == 0 or len(reached) == 0:
        return Interval(None, None, None)
    tail = (1 - CONFIDENCE) / 2
    low, high = int(binom.ppf(tail, n, share)), int(binom.ppf(1 - tail, n, share)) + 1
    return Interval(
        order_statistic(max(1, round(share * n))), order_statistic(low) if low > 0 else 0.0, order_statistic(high)
    )


def moment_rows(ensemble: Ensemble, statistics: Statistics) -> list[dict[str, object]]:
    """Orientation moments, one row per snapshot, body axis and component."""
    rows = []
    for order, (mean, error) in ((SECOND, second_moments(statistics)), (FOURTH, fourth_moments(statistics))):
        for s, time in enumerate(snapshot_times(ensemble)):
            for a, axis in enumerate(ensemble.layout.axes):
                for k, component in enumerate(order):
                    name = "".join("xyz"[i] for i in component)
                    rows.append(
                        {
                            **ensemble_columns(ensemble),
                            "time": time,
                            "body_axis": axis + 1,
                            "moment": name,
                            "mean": float(mean[s, a, k]),
                            "standard_error": float(error[s, a, k]),
                        }
                    )
    return rows


def slow_rows(ensemble: Ensemble, statistics: Statistics) -> list[dict[str, object]]:
    """Means of the slow variables, one row per snapshot and variable."""
    mean, error = slow_means(statistics)
    return [
        {
            **ensemble_columns(ensemble),
            "time": time,
            "variable": f"{name}/Imax",
            "mean": float(mean[s, k]),
            "standard_error": float(error[s, k]),
        }
        for s, time in enumerate(snapshot_times(ensemble))
        for k, name in enumerate(SLOW_NAMES)
    ]


def distribution_rows(ensemble: Ensemble, statistics: Statistics) -> list[dict[str, object]]:
    """Histograms of the slow variables, one row per bin that is not empty; the outermost bins are open."""
    rows = []
    for k, name in enumerate(SLOW_NAMES):
        edges = [-np.inf, *ensemble.layout.edges(name).tolist(), np.inf]
        for s, time in enumerate(snapshot_times(ensemble)):
            counts = statistics.histograms[s, k]
            rows += [
                {
                    **ensemble_columns(ensemble),
                    "time": time,
                    "variable": f"{name}/Imax",
                    "low": edges[place],
                    "high": edges[place + 1],
                    "particles": int(counts[place]),
                }
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
    return row


def ensemble_columns(ensemble: Ensemble) -> dict[str, object]:
    """Columns that tell ensembles apart."""
    a, b, c = ensemble.ellipsoid.semi_axes
    return {"a": a, "b": b, "c": c, "stokes": ensemble.stokes, "equations": ensemble.equations}


def snapshot_times(ensemble: Ensemble) -> list[float]:
    """Times of the snapshots in units of the inverse shear rate."""
    return np.linspace(0.0, ensemble.time, ensemble.snapshots).tolist()
