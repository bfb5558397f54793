"""Problems on which work-precision studies are held to account: classical ones, and cases from public threads.

A problem with neither an exact nor a published solution is solved by SciPy at tight tolerances, independently of
polhode.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import erf
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from polhode import Problem
from polhode.models.problems.catalogue import PROBLEMS
from polhode.models.problems.classical import Classical

# Steps into which SciPy's run is divided at least if the problem is not stiff: it then steps over nothing
# that is short. An estimate.
_LEAST_STEPS = 4000
# Relative tolerances of SciPy's methods, of stiff problems and others, about as tight as they allow, and the
# absolute one.
_STIFF_RTOL = 1e-11
_RTOL = 1e-13
_ATOL = 1e-15


@dataclass(frozen=True)
class Known:
    """A problem, and its solution at the end, shape (d,); None where the solution ends before.

    `classical` is the entry of polhode's catalogue, if the problem is one of it.
    """

    problem: Problem
    end: Callable[[], np.ndarray] | None
    classical: Classical | None = None


def _by_scipy(f: Callable[..., Any], y0: list[float], end: float, stiff: bool) -> np.ndarray:
    """The state at the end, by SciPy."""
    if stiff:
        solution = solve_ivp(f, (0, end), y0, "Radau", rtol=_STIFF_RTOL, atol=_ATOL)
    else:
        step = end / _LEAST_STEPS
        solution = solve_ivp(f, (0, end), y0, "DOP853", rtol=_RTOL, atol=_ATOL, max_step=step)
    return solution.y[:, -1]


def _pulse(centre: float, width: float, decay: float) -> Callable[..., Any]:
    """Rates of y' = -decay y + exp(-((t - centre)/width)²)."""

    def pulse(t, y):
        return [-decay * y[0] + np.exp(-(((t - centre) / width) ** 2))]

    return pulse


def _pulse_end(centre: float, width: float, decay: float, start: float, end: float) -> np.ndarray:
    """The exact state at the end of a run of `_pulse`: the integral of a Gaussian times an exponential."""
    shift = 0.5 * decay * width
    area = (erf((end - centre) / width - shift) + erf(centre / width + shift)) * np.sqrt(np.pi) / 2
    gain = width * area * np.exp(-decay * (end - centre) + shift**2)
    return np.array([start * np.exp(-decay * end) + gain])


# The functions are as users write them. Coefficients are those of textbooks where a problem has a name, and
# made up for the others, as are starts and ends of runs.


def growth(t, y):
    return [y[0]]


def root_of_time(t, y):
    return [np.sqrt(1.0 - t)]


def kink(t, y):
    return [np.abs(np.sin(t)) - 0.1 * y[0]]


def duffing(t, y):
    return [y[1], y[0] - y[0] ** 3 - 0.3 * y[1] + 0.37 * np.cos(1.2 * t)]


def pendulum(t, y):
    return [y[1], -np.sin(y[0])]


def lotka_volterra(t, y):
    return [1.5 * y[0] - y[0] * y[1], -3.0 * y[1] + y[0] * y[1]]


def epidemic(t, y):
    new = 0.5 * y[0] * y[1] / 1000.0
    return [-new, new - 0.1 * y[1], 0.1 * y[1]]


def logistic(t, y):
    return [y[0] * (1 - y[0])]


def prothero_robinson(t, y):
    return [-1e4 * (y[0] - np.cos(t)) - np.sin(t)]


def rossler(t, y):
    return [-y[1] - y[2], y[0] + 0.2 * y[1], 0.2 + y[2] * (y[0] - 5.7)]


def flame(t, y):
    return [y[0] ** 2 - y[0] ** 3]


def fitzhugh_nagumo(t, y):
    return [y[0] - y[0] ** 3 / 3 - y[1] + 0.5, 0.08 * (y[0] + 0.7 - 0.8 * y[1])]


def van_der_pol_100(t, y):
    return [y[1], 100.0 * (1 - y[0] ** 2) * y[1] - y[0]]


def chirp(t, y):
    return [y[1], -(t**2) * y[0]]


def michaelis_menten(t, y):
    bound = 1e3 * y[0] * (1e-3 - y[1]) - 10.0 * y[1]
    return [-bound, bound - 1.0 * y[1], 1.0 * y[1]]


def two_rates(t, y):
    return [-1e6 * y[0] + 1e6 * np.cos(t), y[0] - y[1]]


# A random matrix whose eigenvalues lie within a distance of about 1 from -1.2: solutions die out in the end.
_SIZE = 50
_MATRIX = np.random.default_rng(1).normal(size=(_SIZE, _SIZE)) / np.sqrt(_SIZE) - 1.2 * np.eye(
    _SIZE
)


def linear(t, y):
    return _MATRIX @ y


def heat(t, y):
    inner = [100.0 * (y[i - 1] - 2 * y[i] + y[i + 1]) for i in range(1, 9)]
    return [100.0 * (y[1] - 2 * y[0]), *inner, 100.0 * (y[8] - 2 * y[9])]


def figure_eight(t, y):
    # Places of three bodies of mass 1, then their velocities.
    bodies = [y[2 * i : 2 * i + 2] for i in range(3)]
    rates = []
    for i in range(3):
        force = 0.0
        for j in range(3):
            if i != j:
                apart = bodies[j] - bodies[i]
                square = apart[0] ** 2 + apart[1] ** 2
                force = force + apart / (square * np.sqrt(square))
        rates += [force[0], force[1]]
    return [*y[6:], *rates]


def unstable(t, y):
    return [5.0 * (y[0] - t**2)]


def choke(t, y):
    return [y[0] ** 3 / (1 - y[0] ** 2)]


def root(t, y):
    return [-1 / y[0]]


def blow_up(t, y):
    return [y[0] ** 2]


# Places and velocities of three bodies that chase each other along a figure of eight (Chenciner and
# Montgomery, Ann. Math. 152 (2000)).
_EIGHT = [0.97000436, -0.24308753, -0.97000436, 0.24308753, 0.0, 0.0]
_EIGHT += [0.466203685, 0.43236573, 0.466203685, 0.43236573, -0.93240737, -0.86473146]


def _known(f: Any, y0: list[float], end: float, exact: Any = None, stiff: bool = False) -> Known:
    """A problem with its exact solution at the end, or else with SciPy's."""
    problem = Problem.from_function(f, y0, end)
    return Known(problem, exact or (lambda: _by_scipy(f, y0, end, stiff)))


def _without(f: Any, y0: list[float], end: float) -> Known:
    """A problem whose solution does not reach the end."""
    return Known(Problem.from_function(f, y0, end), None)


OWN = {
    "pulse": _known(
        _pulse(50.0, 3.0, 0.0), [0.0], 100.0, lambda: _pulse_end(50.0, 3.0, 0.0, 0.0, 100.0)
    ),
    "narrow pulse": _known(
        _pulse(50.0, 0.1, 0.1), [1.0], 100.0, lambda: _pulse_end(50.0, 0.1, 0.1, 1.0, 100.0)
    ),
    "spike": _known(
        _pulse(47.3, 0.02, 0.1), [1.0], 100.0, lambda: _pulse_end(47.3, 0.02, 0.1, 1.0, 100.0)
    ),
    "growth": _known(growth, [1e-9], 30.0, lambda: np.array([1e-9 * np.exp(30.0)])),
    "root of time": _known(root_of_time, [0.0], 1.0, lambda: np.array([2 / 3])),
    "kink": _known(kink, [1.0], 20.0),
    "duffing": _known(duffing, [1.0, 0.0], 30.0),
    "pendulum": _known(pendulum, [1.5, 0.0], 40.0),
    "lotka-volterra": _known(lotka_volterra, [10.0, 5.0], 10.0),
    "epidemic": _known(epidemic, [999.0, 1.0, 0.0], 100.0),
    "logistic": _known(logistic, [0.01], 20.0, lambda: np.array([1 / (1 + 99 * np.exp(-20.0))])),
    "prothero-robinson": _known(prothero_robinson, [1.0], 5.0, lambda: np.array([np.cos(5.0)])),
    "rossler": _known(rossler, [1.0, 1.0, 0.0], 20.0),
    "flame": _known(flame, [0.01], 200.0, stiff=True),
    "fitzhugh-nagumo": _known(fitzhugh_nagumo, [-1.0, 1.0], 100.0),
    "van der pol 100": _known(van_der_pol_100, [2.0, 0.0], 200.0, stiff=True),
    "chirp": _known(chirp, [1.0, 0.0], 15.0),
    "michaelis-menten": _known(michaelis_menten, [1.0, 0.0, 0.0], 100.0, stiff=True),
    "two rates": _known(two_rates, [0.0, 0.0], 10.0, stiff=True),
    "linear": _known(linear, [1.0] * _SIZE, 5.0, lambda: expm(5.0 * _MATRIX) @ np.ones(_SIZE)),
    "heat": _known(heat, [1.0] * 10, 0.2),
    "figure eight": _known(figure_eight, _EIGHT, 6.0),
    "unstable": _known(unstable, [0.08], 2.0, lambda: np.array([2.0**2 + 0.8 + 0.08])),
    "choke": _without(choke, [0.3], 5.0),
    "root": _without(root, [1.0], 1.0),
    "blow-up": _without(blow_up, [1.0], 2.0),
}
CLASSICAL = {
    name: Known(classical.problem, lambda known=classical: np.array(known.reference), classical)
    for name, classical in PROBLEMS.items()
    if classical.problem.parameters is not None
}
# About as many.
FORTY = OWN | CLASSICAL
