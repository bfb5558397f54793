"""Summary of an ensemble: means with standard errors, fractions, quantiles with intervals.

Samples are the times at which particles are looked at, snapshots those at which moments and histograms
are kept. A particle has arrived at an attractor, a stable state, once it stays near it up to the end of
the run (`Ensemble`); the transient time is the time until then. The slow variables are the components of
L, its length |L|, and E.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from math import ceil
from typing import Any

import numpy as np

from polhode.harness.common.fits import COVERAGE, wilson
from polhode.harness.ensembles.ensemble import Ensemble
from polhode.harness.ensembles.statistics import (
    FOURTH,
    FOURTH_OF_VOIGT,
    SECOND,
    SLOW_NAMES,
    VOIGT,
    Statistics,
)
from polhode.models.libraries import IMPORTS

# Quantiles of the transient time that a row shows: the median, and the first and the last tenth.
_QUANTILES = (0.1, 0.5, 0.9)
# Places of the squares of `SECOND` in `FOURTH`.
_SQUARES = [FOURTH.index(tuple(sorted((*pair, *pair)))) for pair in SECOND]


@dataclass(frozen=True)
class Estimate:
    """A value with the ends of its confidence interval, of the coverage `COVERAGE`.

    None stands for a time beyond the end of the run, and for what no particle tells.
    """

    value: float | None
    low: float | None
    high: float | None


def means(statistics: Statistics, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Means that belong to the sums `name`, and their standard errors, both of the sums' shape.

    `name` is "second", "fourth", "rates" or "slow". Without a finished particle they are NaN.
    """
    sums = getattr(statistics, name)
    count = statistics.finished
    if count == 0:
        return np.full_like(sums, np.nan), np.full_like(sums, np.nan)
    # The variance of second moments needs ⟨p_i² p_j²⟩, which is a fourth moment.
    squares = (
        statistics.fourth[:, :, _SQUARES]
        if name == "second"
        else getattr(statistics, f"{name}_squares")
    )
    mean = sums / count
    variance = np.maximum(squares / count - mean**2, 0)
    return mean, np.sqrt(variance / max(count - 1, 1))


def fraction(count: int, of: int) -> Estimate:
    """The fraction `count` of `of`, with its interval; of no cases it is None, and lies between 0 and 1."""
    return Estimate(count / of if of else None, *wilson(count, of))


def arrived(statistics: Statistics, attractor: int) -> list[Estimate]:
    """Fraction of the finished particles that have come to an attractor for good, at each sample."""
    return [
        fraction(int(count), statistics.finished)
        for count in np.cumsum(statistics.arrivals[attractor])
    ]


def transient_quantile(ensemble: Ensemble, statistics: Statistics, share: float) -> Estimate:
    """Quantile of the time, in units of the inverse shear rate, after which a particle has arrived anywhere.

    `share`, from 0 to 1, of the particles have arrived by then.
    """
    # Without assumption on the distribution: the interval lies between the order statistics whose
    # ranks bound a binomial variable (Conover, Practical Nonparametric Statistics, section 3.2).
    # Particles that have not arrived by the end count as later; times are known to one sample, and
    # rounded up. `reached` counts the particles that have arrived by each sample.
    n = statistics.finished
    reached = np.cumsum(np.sum(statistics.arrivals, axis=0))
    times = np.linspace(0.0, ensemble.time, ensemble.samples)

    def order_statistic(rank: int) -> float | None:
        """Time by which this many particles have arrived; None if fewer have by the end."""
        place = int(np.searchsorted(reached, rank))
        return float(times[place]) if rank <= n and place < len(times) else None

    if n == 0 or len(reached) == 0:
        return Estimate(None, None, None)
    # The share of the interval's misses at either end.
    tail = (1 - COVERAGE) / 2
    with IMPORTS:
        from scipy.special import bdtrik

    # bdtrik(p, n, share) is the k, made real, for which a binomial variable X of n trials has P(X ≤ k) = p.
    low = ceil(bdtrik(tail, n, share))
    high = ceil(bdtrik(1 - tail, n, share)) + 1
    earliest = order_statistic(low) if low > 0 else 0.0
    return Estimate(order_statistic(max(1, round(share * n))), earliest, order_statistic(high))


def moment_rows(ensemble: Ensemble, statistics: Statistics) -> Iterator[dict[str, object]]:
    """Orientation moments, one row per snapshot, body axis and component."""
    for name, order in (("second", SECOND), ("fourth", FOURTH)):
        components = [_in_letters(indices) for indices in order]
        yield from mean_rows(ensemble, statistics, name, moment=components)


def voigt_rows(ensemble: Ensemble, statistics: Statistics) -> Iterator[dict[str, object]]:
    """Fourth moments as matrices in Voigt's order, one row per snapshot, body axis and entry from the diagonal on."""
    # As tensors of stiffness are written: no factors stand before the components (Voigt 1910; of
    # orientation: Advani and Tucker, J. Rheol. 31 (1987) 751).
    names = [_in_letters(pair) for pair in VOIGT]
    rows = mean_rows(
        ensemble, statistics, "fourth", (..., FOURTH_OF_VOIGT), row=names, column=names
    )
    return (row for row in rows if names.index(row["row"]) <= names.index(row["column"]))


def _in_letters(indices: Sequence[int]) -> str:
    """Indices 0, 1 and 2 of a component as x, y and z."""
    return "".join("xyz"[i] for i in indices)


def mean_rows(
    ensemble: Ensemble, statistics: Statistics, of: str, chosen: Any = ..., **more: Sequence[str]
) -> Iterator[dict[str, Any]]:
    """One row for each of the chosen `means`: a row has a time, a body axis (no slow variable has one), and labels.

    `of` names the sums. `chosen` indexes the array of means, whose axes are times, body axes and
    components. `more` has the labels along the further axes, by the names of their columns.
    """
    axes: dict[str, Sequence[Any]] = {"time": snapshot_times(ensemble)}
    if "variable" not in more:
        axes["body_axis"] = [axis + 1 for axis in ensemble.layout.axes]
    axes |= more
    values = (array[chosen].ravel().tolist() for array in means(statistics, of))
    for place, mean, error in zip(product(*axes.values()), *values, strict=True):
        columns = {**ensemble_columns(ensemble), **dict(zip(axes, place, strict=True))}
        yield {**columns, "mean": mean, "standard_error": error}


def distribution_rows(ensemble: Ensemble, statistics: Statistics) -> Iterator[dict[str, object]]:
    """Histograms of the slow variables, one row per bin that is not empty; the outermost bins are open."""
    for k, name in enumerate(SLOW_NAMES):
        edges = [-np.inf, *ensemble.layout.edges(name).tolist(), np.inf]
        for s, time in enumerate(snapshot_times(ensemble)):
            counts = statistics.histograms[s, k]
            columns = {**ensemble_columns(ensemble), "time": time, "variable": f"{name}/Imax"}
            for place in np.flatnonzero(counts).tolist():
                yield {
                    **columns,
                    "low": edges[place],
                    "high": edges[place + 1],
                    "particles": int(counts[place]),
                }


def arrival_rows(ensemble: Ensemble, statistics: Statistics) -> Iterator[dict[str, object]]:
    """Fraction arrived at each attractor, one row per attractor and sample.

    An attractor's name is its `rotation`, the body axis along the vorticity.
    """
    times = np.linspace(0.0, ensemble.time, ensemble.samples).tolist()
    for k, attractor in enumerate(ensemble.attractors):
        columns = {**ensemble_columns(ensemble), "attractor": attractor.rotation}
        for time, share in zip(times, arrived(statistics, k), strict=True):
            yield {
                **columns,
                "time": time,
                "fraction": share.value,
                "low": share.low,
                "high": share.high,
            }


def ensemble_row(ensemble: Ensemble, statistics: Statistics) -> dict[str, object]:
    """The ensemble in one row: counts, the fraction arrived at each attractor, quantiles of the transient time."""
    ends = ensemble.attractors
    quantiles = _QUANTILES if ensemble.attractors else ()
    return {
        **ensemble_columns(ensemble),
        "form": ensemble.form,
        "tolerance": ensemble.tolerance,
        "duration": ensemble.time,
        "slow_time": ensemble.slow_time,
        "particles": statistics.particles,
        "failures": statistics.failures,
        "arrived": {end.rotation: vars(arrived(statistics, k)[-1]) for k, end in enumerate(ends)},
        "transient_time": {
            f"{share:g}": vars(transient_quantile(ensemble, statistics, share))
            for share in quantiles
        },
        "method": ensemble.method,
    }


def ensemble_columns(ensemble: Ensemble) -> dict[str, object]:
    """Columns that tell ensembles apart."""
    a, b, c = ensemble.ellipsoid.semi_axes
    return {"a": a, "b": b, "c": c, "stokes": ensemble.stokes, "equations": ensemble.equations}


def snapshot_times(ensemble: Ensemble) -> list[float]:
    """Times of the snapshots in units of the inverse shear rate."""
    return np.linspace(0.0, ensemble.time, ensemble.snapshots).tolist()
