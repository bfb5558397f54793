"""Robust least squares with prior knowledge, and the bootstrap over groups of measurements."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

Array = np.ndarray

REPLICATES = 40
SEED = 1
QUANTILES = (0.025, 0.5, 0.975)
# Levenberg and Marquardt: iterations, relative gain of the loss at which they stop, damping, difference step.
MOST_ITERATIONS, CLOSE, LARGEST_DAMPING, DIFFERENCE = 50, 1e-5, 1e8, 1e-4


@dataclass(frozen=True)
class Misfit:
    """Measurements, what a law predicts of them, and what is expected of its parameters.

    Parameters
    ----------
    measured : ndarray, shape (n,)
        Logarithms.
    predicted : callable
        Of parameters, shape (d,), gives logarithms, shape (n,).
    prior : dict
        Mean and standard deviation of each parameter.
    soft : float
        Residuals beyond it pull less.
    """

    measured: Array
    predicted: Callable[[Array], Array]
    prior: dict[str, tuple[float, float]]
    soft: float

    def residual(self, x: Array) -> Array:
        """Measured less predicted."""
        return self.measured - self.predicted(x)

    def fit(self, x: Array, weights: Array) -> Array:
        """Parameters, from a start, of least squares with the soft-L1 loss, by Levenberg's and Marquardt's method.

        Source: Nocedal and Wright, Numerical Optimization, section 10.3; the loss by reweighting.
        """
        mean, spread = np.array(list(self.prior.values())).T

        def loss(x: Array, residual: Array) -> float:
            soft = 2 * self.soft**2 * (np.sqrt(1 + (residual / self.soft) ** 2) - 1)
            return float(weights @ soft + self.soft**2 * np.sum(((x - mean) / spread) ** 2))

        damping, residual = 1e-2, self.residual(x)
        value = loss(x, residual)
        for _ in range(MOST_ITERATIONS):
            pull = weights / np.sqrt(1 + (residual / self.soft) ** 2)
            slopes = self._slopes(x)
            matrix = slopes.T @ (pull[:, None] * slopes) + np.diag(self.soft**2 / spread**2)
            gradient = slopes.T @ (pull * residual) - self.soft**2 * (x - mean) / spread**2
            while damping < LARGEST_DAMPING:
                tried = x + np.linalg.solve(matrix + damping * np.diag(np.diag(matrix)), gradient)
                there = self.residual(tried)
                better = loss(tried, there)
                if better <= value:
                    break
                damping *= 10
            else:
                return x
            done = value - better <= CLOSE * value
            x, residual, value, damping = tried, there, better, damping / 10
            if done:
                return x
        return x

    def _slopes(self, x: Array) -> Array:
        """Derivatives of the predictions, shape (n, d), by central differences."""
        steps = DIFFERENCE * np.eye(len(x))
        return np.stack([self.predicted(x + step) - self.predicted(x - step) for step in steps], 1) / (2 * DIFFERENCE)


@dataclass(frozen=True)
class Fit:
    """Parameters from all measurements, those from resampled groups, and what the latter make of left-out groups.

    Parameters
    ----------
    names : tuple of str, length d
    parameters : ndarray, shape (d,)
    replicates : ndarray, shape (`REPLICATES`, d)
    strays : tuple of 3 float
        Quantiles 2.5, 50 and 97.5 % of measured less predicted in the groups left out, wider for few groups.
    """

    names: tuple[str, ...]
    parameters: Array
    replicates: Array
    strays: tuple[float, float, float]

    def in_words(self, logarithms: int) -> tuple[dict[str, Any], dict[str, Any]]:
        """Parameters and their 95 % intervals by name, the first ones out of their logarithms."""
        rows = np.vstack([self.parameters, np.quantile(self.replicates, (QUANTILES[0], QUANTILES[2]), axis=0)])
        rows[:, :logarithms] = np.exp(rows[:, :logarithms])
        value, low, high = rows.tolist()
        intervals = {name: list(ends) for name, *ends in zip(self.names, low, high, strict=True)}
        return dict(zip(self.names, value, strict=True)), intervals


def bootstrap(groups: Sequence[str], misfit: Misfit) -> Fit:
    """Fit, and fit again to groups drawn with replacement.

    Source: Efron and Tibshirani, An Introduction to the Bootstrap, sections 6.2 and 17.7 (left-out groups).

    Parameters
    ----------
    groups : sequence of str, length n
        Group of each measurement: what one group says of another is what a prediction is worth.
    misfit : Misfit
    """
    index = {name: i for i, name in enumerate(dict.fromkeys(groups))}
    group = np.array([index[name] for name in groups])
    x = misfit.fit(np.array([mean for mean, _ in misfit.prior.values()]), np.ones(len(groups)))
    random = np.random.default_rng(SEED)
    replicates, strays = [], []
    for _ in range(REPLICATES):
        drawn = np.bincount(random.integers(len(index), size=len(index)), minlength=len(index))
        weights = drawn[group].astype(float)
        fitted = misfit.fit(x, weights)
        replicates.append(fitted)
        strays.append(misfit.residual(fitted)[weights == 0])
    low, middle, high = np.quantile(np.concatenate(strays), QUANTILES).tolist()
    wider = _few(len(index))
    ends = middle + wider * (low - middle), middle, middle + wider * (high - middle)
    return Fit(tuple(misfit.prior), x, np.array(replicates), ends)


def _few(groups: int) -> float:
    """How much wider an interval for one more group is when only a few were seen: Student's t over the normal one."""
    from scipy.special import ndtri, stdtrit

    return float(stdtrit(groups - 1, QUANTILES[2]) * np.sqrt(1 + 1 / groups) / ndtri(QUANTILES[2]))
