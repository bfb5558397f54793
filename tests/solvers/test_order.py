"""Convergence order at fixed steps, where a library lets steps be fixed: the slope of log error against log step."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from oracle.classical import CLASSICAL
from polhode.solvers.catalogue import solver
from polhode.solvers.compile import plain_field
from polhode.solvers.solve import solve

RIGID_BODY = CLASSICAL["rigid-body"].problem
FIELD = plain_field(RIGID_BODY.field)
END = 20.0
# Everything is accepted: the step is the largest that is allowed.
LOOSE = {"rtol": 1e6, "atol": 1e6}


def with_scipy(method: str, step: float) -> np.ndarray:
    return solve_ivp(
        lambda t, y: FIELD(y, ()),
        (0, END),
        RIGID_BODY.start,
        method,
        max_step=step,
        first_step=step,
        **LOOSE,
    ).y[:, -1]


def with_cyrk(method: str, step: float) -> np.ndarray:
    from CyRK import pysolve_ivp

    def field(dy: np.ndarray, t: float, y: np.ndarray) -> None:
        dy[:] = FIELD(y, ())

    return pysolve_ivp(
        field,
        (0.0, END),
        np.array(RIGID_BODY.start),
        method,
        max_step=step,
        first_step=step,
        pass_dy_as_arg=True,
        **LOOSE,
    ).y[:, -1]


@pytest.mark.parametrize(
    ("name", "run", "order", "steps"),
    [
        ("rk45", with_scipy, 5, (100, 200, 400)),
        ("dop853", with_scipy, 8, (40, 57, 80, 113)),
        ("cyrk-tsit5", with_cyrk, 5, (100, 200, 400)),
        ("cyrk-vern7", with_cyrk, 7, (160, 226, 320)),
        # The leading term is so small that the next one shows, until roundoff hides both.
        ("cyrk-vern8", with_cyrk, 9, (40, 57, 80, 113)),
        ("cyrk-dop853", with_cyrk, 8, (40, 57, 80, 113)),
    ],
)
def test_order(
    name: str, run: Callable[[str, float], np.ndarray], order: int, steps: tuple[int, ...]
):
    exact = solve(RIGID_BODY, "taylor", 1e-16, np.array([0.0, END])).states[-1]
    method = solver(name).method
    errors = [np.abs(run(method, END / n) - exact).max() for n in steps]
    assert min(errors) > 1e-13
    slope = -np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert slope == pytest.approx(order, abs=0.5)
