"""A solver of one's own: one more method of SciPy's. `docs/examples/own_solver.py` writes one from nothing."""

from polhode.solvers.scipy_ivp import ScipySolver


class Rk23(ScipySolver):
    """Bogacki and Shampine's explicit Runge-Kutta pair of order 3(2)."""

    name = "my-rk23"
    summary = "explicit Runge-Kutta 3(2) (SciPy)"
    method = "RK23"
    attempt = 3
    low_order = True
    error_constant = 500.0  # 152 measured
