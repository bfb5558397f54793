"""Nodes, shares and weights of splitting's mean of eight compositions, by least squares (`docs/method.md`).

Run ``python docs/derivations/splitting_mean.py``: it prints what steps of `PARALLEL` and of
ABA(10,6,4), both in `polhode.solvers.parts.schemes`, are off by, and how far least squares moves
the coefficients of `PARALLEL`, which are where a search was stopped. ``--search SEED`` searches,
from random ones and from around the best so far.

A step turns the fast angle by h. Seen from a frame that turns along, the slow part is B(x), -1 < x
< 1, a sum of oscillations of up to two per turn, e^{imhx/2} with |m| <= 2. The exact step is the
sum of the integrals, by h dx/2, of 1, B(x₁), B(x₁)B(x₂), B(x₁)B(x₂)B(x₃), ... over x₁ < x₂ < x₃ <
.... A composition, a product of exp(h b_i B(x_i)), is a like sum; in it products at one node count
1/2 if they are of two, and 1/6 of three.

With e^{ihx} = Σ (2k+1) iᵏ j_k(h) P_k(x) the condition is: in the mean, by weight, of compositions
and their mirror images, moments of ordered products of Legendre polynomials are their integrals by
dx/2. What a moment is off by counts as much as its polynomials do in the quickest oscillation,
(2k+1)|j_k(h)| each, and `RATE` h for each flow after one. Products of two with k + l even are
symmetric, P_k P_l + P_l P_k, those with k + l odd commutators. The symmetric ones of one
composition follow from products of one; those of a mean do not, and what they are off by is no
error of a flow. They count `SYMMETRIC` times.

At St = 1e5, for κ = 0.1, 2 and 10, steps of 1.3 to 3.3 rad err at least 4 times less than as many of
ABA(10,6,4); shorter and wider ones, or those at a larger torque, may err more. Tried by hand, with
less gain: a step in angle or in time, the isotropic damping in the exact rotation, Strang's scheme
between smooth starts and ends, or between correctors that make it exact to first order in the
torque, Blanes and Moan's scheme of 14 stages for Nyström's kind of problem, SABA3 with the bracket
[B, [A, B]] of rotation A and relaxation B, extrapolation from two runs, and chains of three flows.
"""

import itertools
from argparse import ArgumentParser

import numpy as np
from numpy.polynomial.legendre import Legendre, legvander
from scipy.optimize import OptimizeResult, least_squares
from scipy.special import spherical_jn

from polhode.solvers.parts.schemes import ABA, PARALLEL, Scheme

# Polynomials in products of one, two and three slow flows; relaxation per rad; steps, in rad, that
# are fitted.
SIZES, RATE, STEPS, SYMMETRIC = (13, 8, 3), 0.01, (0.4, 1.0, 2.0, 3.0, 3.8), 99.0
# Most of nodes on (-1, 1), shares and weights that are looked for.
MOST, STAGES, CHAINS = (1.6, 1.5, 2.0), PARALLEL.stages, len(PARALLEL.weights)
# Of moments, one after another: products of one, symmetric ones of two, commutators, products of
# three.
NAMES = ("one", "symmetric", "commutators", "three")
KINDS = np.repeat([0, 1, 3], [size**length for length, size in enumerate(SIZES, 1)])
KINDS[KINDS == 1] += np.add.outer(np.arange(SIZES[1]), np.arange(SIZES[1])).ravel() % 2


def exact() -> np.ndarray:
    """Integrals of ordered products of Legendre polynomials, by dx/2."""
    moments = []
    for length, size in enumerate(SIZES, 1):
        inner = [Legendre([1.0])]
        for _ in range(length):
            inner = [(f * Legendre.basis(k)).integ(lbnd=-1) / 2 for f in inner for k in range(size)]
        moments += [f(1.0) for f in inner]
    return np.array(moments)


EXACT = exact()


def off(nodes: np.ndarray, shares: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """What the moments of a mean of compositions are off by; their slow flows are along the last axis."""
    rows, (_, n, m) = shares.shape[:-1], SIZES
    one, two, three = (np.zeros((*rows, *(size,) * length)) for length, size in enumerate(SIZES, 1))
    for e in np.moveaxis(legvander(nodes, SIZES[0] - 1) * shares[..., None], -2, 0):
        pairs = two[..., :m, :m] + (one[..., :m] / 2 + e[..., :m] / 6)[..., None] * e[..., None, :m]
        three = three + pairs[..., None] * e[..., None, None, :m]
        two, one = two + (one[..., :n] + e[..., :n] / 2)[..., None] * e[..., None, :n], one + e
    moments = np.concatenate([each.reshape(*rows, -1) for each in (one, two, three)], axis=-1)
    return np.einsum("...c,...cm->...m", weights, moments) - EXACT


def counts(h: float) -> np.ndarray:
    """As how much moments count in a step; the first is met by shares and weights that add up to 1."""
    k, (_, n, m) = np.arange(SIZES[0]), SIZES
    one = (2 * k + 1) * np.abs(spherical_jn(k, h))
    two = np.multiply.outer(one[:n], one[:n]) * RATE * h
    three = np.multiply.outer(two[:m, :m], one[:m]) * RATE * h
    return np.concatenate([one * (k > 0), two.ravel(), three.ravel()])


def coefficients(scheme: Scheme) -> tuple[np.ndarray, ...]:
    """Nodes on (-1, 1), shares and weights of a scheme, as machine code receives them."""
    chains, n = scheme.chains, scheme.stages
    fast, slow, weights = np.split(
        scheme.listed(float)[1:], [(n + 1) * chains, (2 * n + 1) * chains]
    )
    return (
        2 * np.cumsum(fast.reshape(-1, chains), axis=0)[:-1].T - 1,
        slow.reshape(-1, chains).T,
        weights,
    )


IN_USE = np.column_stack(coefficients(PARALLEL))[:CHAINS].ravel()


def residuals(scheme: Scheme, h: float) -> np.ndarray:
    """Root of the sum of squares of what moments of each kind are off by in a step, as much as they count."""
    return np.sqrt(np.bincount(KINDS, (counts(h) * off(*coefficients(scheme))) ** 2))


def objective() -> np.ndarray:
    """As how much moments count in all steps fitted, where what ABA(10,6,4) is off by is 1 in each."""
    squares = sum((counts(h) / np.linalg.norm(residuals(ABA, h))) ** 2 for h in STEPS)
    return np.sqrt(squares) * np.where(KINDS == 1, SYMMETRIC, 1.0)


def mean(x: np.ndarray) -> tuple[np.ndarray, ...]:
    """Nodes, shares and weights from the unknowns: those of the compositions whose mirror images come after them."""
    x = x.reshape(*x.shape[:-1], CHAINS, 2 * STAGES + 1)
    nodes, shares, weights = x[..., :STAGES], x[..., STAGES:-1], x[..., -1]
    shares, weights = (
        shares / shares.sum(-1, keepdims=True),
        weights / (2 * weights.sum(-1, keepdims=True)),
    )
    nodes, shares = (
        np.concatenate([a, b[..., ::-1]], axis=-2) for a, b in ((nodes, -nodes), (shares, shares))
    )
    return nodes, shares, np.concatenate([weights, weights], axis=-1)


def improved(x: np.ndarray, count: np.ndarray, most: int) -> OptimizeResult:
    """Least squares from given unknowns."""

    def fit(x: np.ndarray) -> np.ndarray:
        return count * off(*mean(x))

    d, stop = 1e-6 * np.eye(x.size), {"ftol": 1e-14, "xtol": 1e-14, "max_nfev": most}
    return least_squares(fit, x, lambda x: (fit(x + d) - fit(x - d)).T / 2e-6, **stop)


def compare() -> None:
    """Print what steps are off by, and what least squares makes of the coefficients in use."""
    print("step", *(f"{name:>11}" for name in NAMES * 2), " mean/ABA")
    for h in np.arange(0.2, 4.7, 0.2):
        ours, single = residuals(PARALLEL, h), residuals(ABA, h)
        ratio = np.linalg.norm(ours) / np.linalg.norm(single)
        print(f"{h:4.1f}", *(f"{value:11.1e}" for value in (*ours, *single)), f"{ratio:9.3f}")
    count, before = objective(), mean(IN_USE)
    print(
        f"steps {STEPS}, symmetric ones times {SYMMETRIC:g}: {np.linalg.norm(count * off(*before)):.5f}"
    )
    beside = [
        np.linalg.norm(count * off(*mean(IN_USE + near))) for near in 1e-6 * np.eye(IN_USE.size)
    ]
    print(f"with any one unknown moved by 1e-6: {min(beside):.2f} to {max(beside):.0f}")
    for most in (30, 300, 2000):
        better = improved(IN_USE, count, most)
        moved = [f"{np.abs(a - b).max():.1e}" for a, b in zip(before, mean(better.x), strict=True)]
        print(
            f"least squares, {most:4}: {np.sqrt(2 * better.cost):.5f}; nodes, shares, weights moved by",
            *moved,
        )


def search(seed: int) -> None:
    """Print whatever is better than all before; every third start has nothing to do with them."""
    random, count, best, least = np.random.default_rng(seed), objective(), np.empty(0), np.inf
    for start in itertools.count():
        nodes, shares = (
            random.uniform(-1, 1, (CHAINS, STAGES)),
            random.normal(1, 0.3, (CHAINS, STAGES)),
        )
        x = np.column_stack([np.sort(nodes), shares, random.normal(1, 0.7, CHAINS)]).ravel()
        if start % 3 and best.size:
            x = best + random.normal(0, random.choice([0.005, 0.03, 0.1]), x.size)
        found = improved(x, count, 120)
        if found.cost < 9 * least:
            found = improved(found.x, count, 1200)
        each = mean(found.x)
        if found.cost < least and all(
            np.abs(a).max() < most for a, most in zip(each, MOST, strict=True)
        ):
            best, least = found.x, found.cost
            print(
                f"start {start}: {np.sqrt(2 * least):.5f}",
                *(a[:CHAINS] for a in each),
                sep="\n",
                flush=True,
            )


if __name__ == "__main__":
    parser = ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--search", type=int, metavar="SEED")
    given = parser.parse_args().search
    compare() if given is None else search(given)
