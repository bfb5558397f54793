"""Statistics of an ensemble: sums and counts of fixed size, whatever the number of particles, that can be merged.

An axis p is a unit vector along a body axis, in space axes; its moments are the means of products of its
components. Particles are looked at at the times of samples. Some samples are snapshots: they give moments
and histograms. `polhode.harness.ensembles.summary` makes means of the sums.
"""

from collections import Counter
from dataclasses import dataclass, fields
from itertools import combinations_with_replacement, product
from typing import Any, Self

import numpy as np

# Indices of the moments of an axis p: p_i p_j with i <= j, and p_i p_j p_k p_l likewise, 6 and 15 of
# them. All others are equal to one of these.
SECOND = tuple(combinations_with_replacement(range(3), 2))
FOURTH = tuple(combinations_with_replacement(range(3), 4))
# Pairs of components in Voigt's order, and the place in `FOURTH` of the moment of two pairs, shape (6, 6).
VOIGT = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))
_VOIGT_PAIRS = product(VOIGT, VOIGT)
_FOURTH_PLACES = [FOURTH.index(tuple(sorted((*row, *column)))) for row, column in _VOIGT_PAIRS]
FOURTH_OF_VOIGT = np.array(_FOURTH_PLACES).reshape(len(VOIGT), len(VOIGT))
# Mean squares of rates, of rotation about a body axis p and of p itself (Voth and Soldati, Annu.
# Rev. Fluid Mech. 49 (2017) 249).
RATES = ("spinning", "tumbling")
# Slow variables whose distributions are counted, in units of the largest moment of inertia.
SLOW_NAMES = ("Lx", "Ly", "Lz", "L", "E")


@dataclass(frozen=True)
class Layout:
    """Counted quantities and their limits."""

    axes: tuple[int, ...]  # body axes whose orientation moments are summed
    snapshots: int  # times at which moments and distributions are taken
    samples: int  # times at which particles are looked at for their arrival
    attractors: int  # fixed points of the averaged motion at which particles arrive
    bins: int  # of each histogram between its limits; two more count what lies beyond
    largest_momentum: float  # limit of |L| and ± its components, over the largest moment of inertia
    largest_energy: float  # limit of E, over the same

    def edges(self, name: str) -> np.ndarray:
        """Inner bin edges of a slow variable, shape (bins + 1,)."""
        high = self.largest_energy if name == "E" else self.largest_momentum
        return np.linspace(0.0 if name in ("L", "E") else -high, high, self.bins + 1)


def squared_rates(omega: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """(ω·p)² and |dp/dt|² = ω² - (ω·p)², shape (n, A, 2), from ω, shape (n, 3), and body axes p, shape (n, A, 3)."""
    along = np.square(np.einsum("nj,naj->na", omega, axes))
    return np.stack([along, np.square(omega).sum(axis=1)[:, None] - along], axis=-1)


@dataclass
class Statistics:
    """Sums over the particles that did not fail, with S snapshots, A axes, M samples; `SLOW_NAMES` over I_max."""

    particles: int  # all that were started
    failures: Counter[str]  # particles by the status of their failure
    second: np.ndarray  # Σ p_i p_j in the order of `SECOND`, shape (S, A, 6)
    fourth: np.ndarray  # Σ p_i p_j p_k p_l in the order of `FOURTH`, shape (S, A, 15)
    # Arrays `…_squares` hold sums of the squares of the same terms, from which standard errors follow.
    fourth_squares: np.ndarray
    rates: np.ndarray  # Σ (ω·p)² and Σ |dp/dt|², shape (S, A, 2)
    rates_squares: np.ndarray
    slow: np.ndarray  # Σ of the slow variables, shape (S, 5)
    slow_squares: np.ndarray
    histograms: np.ndarray  # of int, shape (S, 5, bins + 2)
    # Particles by the sample from which on they stayed close, of int, shape (attractors, M).
    arrivals: np.ndarray

    @classmethod
    def empty(cls, layout: Layout) -> Self:
        """No particles yet."""
        of_axes = (layout.snapshots, len(layout.axes))
        of_slow = (layout.snapshots, len(SLOW_NAMES))
        return cls(
            particles=0,
            failures=Counter(),
            second=np.zeros((*of_axes, len(SECOND))),
            fourth=np.zeros((*of_axes, len(FOURTH))),
            fourth_squares=np.zeros((*of_axes, len(FOURTH))),
            rates=np.zeros((*of_axes, len(RATES))),
            rates_squares=np.zeros((*of_axes, len(RATES))),
            slow=np.zeros(of_slow),
            slow_squares=np.zeros(of_slow),
            histograms=np.zeros((*of_slow, layout.bins + 2), dtype=np.int64),
            arrivals=np.zeros((layout.attractors, layout.samples), dtype=np.int64),
        )

    @property
    def finished(self) -> int:
        """Particles that reached the end."""
        return self.particles - sum(self.failures.values())

    def add_statuses(self, statuses: np.ndarray, success: str) -> np.ndarray:
        """Count particles; returns which of them succeeded, shape (n,)."""
        self.particles += len(statuses)
        self.failures.update(statuses[statuses != success].tolist())
        return statuses == success

    def add_orientations(self, directions: np.ndarray) -> None:
        """Add unit vectors, shape (S, n, A, 3)."""
        # Shape (3, S, A, n): sums over particles run along the last axis.
        components = np.ascontiguousarray(directions.transpose(3, 0, 2, 1))
        pairs = {pair: components[pair[0]] * components[pair[1]] for pair in SECOND}
        for k, pair in enumerate(SECOND):
            self.second[:, :, k] += pairs[pair].sum(axis=-1)
        for k, (i, j, m, n) in enumerate(FOURTH):
            product = pairs[i, j] * pairs[m, n]
            self.fourth[:, :, k] += product.sum(axis=-1)
            self.fourth_squares[:, :, k] += np.square(product).sum(axis=-1)

    def add_slow(self, layout: Layout, slow: np.ndarray) -> None:
        """Add slow variables (L_x, L_y, L_z, E) over the largest moment of inertia, shape (S, n, 4)."""
        length = np.linalg.norm(slow[..., :3], axis=-1)
        columns = [slow[..., 0], slow[..., 1], slow[..., 2], length, slow[..., 3]]
        for k, (name, values) in enumerate(zip(SLOW_NAMES, columns, strict=True)):
            self.slow[:, k] += values.sum(axis=1)
            self.slow_squares[:, k] += np.square(values).sum(axis=1)
            edges = layout.edges(name)
            # Bin 0 lies below the limits, bin `bins` + 1 above.
            widths = np.floor((values - edges[0]) * (layout.bins / (edges[-1] - edges[0])))
            places = np.clip(widths.astype(np.int64) + 1, 0, layout.bins + 1)
            for snapshot, row in enumerate(places):
                self.histograms[snapshot, k] += np.bincount(row, minlength=layout.bins + 2)

    def add_arrivals(self, attractor: int, close: np.ndarray) -> None:
        """Add particles by the first sample from which on they are close to an attractor; shape (M, n) of bool."""
        # `staying` counts the samples at which a particle is close without a break up to the end of the run.
        # It arrived at the first of them. Reversed in time, the first sample that is not close ends the stay.
        samples = len(close)
        staying = np.where(np.all(close, axis=0), samples, np.argmin(close[::-1], axis=0))
        first = samples - staying[staying > 0]
        self.arrivals[attractor] += np.bincount(first, minlength=samples)

    def merge(self, other: "Statistics") -> None:
        """Add the sums of other particles of the same ensemble; their last digits depend on the order of merging."""
        self.particles += other.particles
        self.failures.update(other.failures)
        for name in _ARRAYS:
            getattr(self, name).__iadd__(getattr(other, name))

    def as_record(self) -> dict[str, Any]:
        """As plain data, without loss."""
        arrays = {name: getattr(self, name).tolist() for name in _ARRAYS}
        return {"particles": self.particles, "failures": dict(self.failures), **arrays}

    @classmethod
    def from_record(cls, record: dict[str, Any], layout: Layout) -> Self:
        """The statistics that `as_record` wrote."""
        empty = cls.empty(layout)
        for name in _ARRAYS:
            array = getattr(empty, name)
            array[...] = np.array(record[name], dtype=array.dtype).reshape(array.shape)
        empty.particles = record["particles"]
        empty.failures = Counter(record["failures"])
        return empty


# Names of the sums and counts that are arrays.
_ARRAYS = tuple(
    field.name for field in fields(Statistics) if field.name not in ("particles", "failures")
)
