"""Section "Spheroids" at the pinch point L = 0: how full and slow trajectories pass it."""

from math import pi, sqrt

import numpy as np
from scipy.optimize import brentq

from polhode.harness.paper.item import Computed, Grid, Table
from polhode.harness.paper.planes import aligned_scene
from polhode.harness.paper.runs import (
    Run,
    averaged_run,
    full_run,
    run_form,
    slow_run_to_pinch,
    spheroid,
)
from polhode.harness.paper.tables import exponent, path, root_mean_squares
from polhode.models.catalogue import form as find_form
from polhode.models.forms.spheroid import Spheroid
from polhode.models.scene import BodyStart, Scene

# Shown in the planes; L_z over I_max at the start, θ₀, and the tilt of L, in rad, of the second
# plane.
KAPPA, MOMENTUM, THETA, TILT = 2.0, 0.4, 0.3, 0.2
STOKES, SLOW_TIME = (1e3, 1e4, 1e5), 0.12
# Half sizes of the magnified view, over I_max.
CLOSE = 0.045, 0.0024
# Measured in its width: below and above the aspect ratio at which the paper's St^-1/2 ceases to
# hold.
KAPPAS = (1.2, 2.0, 3.0)
# Half the window around the crossing in which the smallest |L| is looked for, over I_max.
WINDOW = 0.05
# St at which `hybrid`, which follows the neighbourhood by the full equations, is compared with a
# full run throughout.
COMPARED = 1e7


def compute_pinch(grid: Grid) -> Computed:
    """Paths past the pinch point; the smallest |L| of full runs against St."""
    slow_times = np.linspace(0.0, SLOW_TIME, grid.of(1201, 601))
    ends, pinch = _slow_to_pinch(KAPPA, slow_times)
    yield "aligned", path(np.inf, ends.times, ends.slow)
    yield "tilted", path(np.inf, slow_times, averaged_run(_tilted_scene(1.0), slow_times).slow)
    for stokes in STOKES:
        for table, scene in (("aligned", _scene(KAPPA, stokes)), ("tilted", _tilted_scene(stokes))):
            yield table, path(stokes, slow_times, full_run(scene, stokes * slow_times).slow)
    yield "end", {"t2": pinch}
    phases = ((np.arange(grid.of(8, 2)) + 0.25) * pi / grid.of(8, 2)).tolist()
    for kappa in KAPPAS:
        _, met = _slow_to_pinch(kappa, slow_times)
        for stokes in np.geomspace(1e4, 1e9, grid.of(11, 6)).tolist():
            least = [_least_momentum(kappa, stokes, phi, met) for phi in phases]
            yield "crossing", {"kappa": kappa, "stokes": stokes, "phi": phases, "least": least}
        forms = {"hybrid": "hybrid", "full": "spheroid-axis"}
        pair = {
            name: _least_momentum(kappa, COMPARED, phases[0], met, form)
            for name, form in forms.items()
        }
        yield "compared", {"kappa": kappa, **pair}


def _scene(kappa: float, stokes: float, phi: float = 0.0, slow_time: float = SLOW_TIME) -> Scene:
    """L along the vorticity."""
    return aligned_scene(spheroid(kappa), stokes, MOMENTUM, THETA, slow_time, phi)


def _tilted_scene(stokes: float) -> Scene:
    """The same start turned about the flow axis, so that L gets a component along the gradient."""
    aligned = _scene(KAPPA, stokes)
    q0, q1, q2, q3 = aligned.start.quaternion  # pyright: ignore[reportAttributeAccessIssue]
    c, s = np.cos(TILT / 2), np.sin(TILT / 2)
    turned = (c * q0 - s * q1, c * q1 + s * q0, c * q2 - s * q3, c * q3 + s * q2)
    return Scene(
        aligned.ellipsoid, stokes, BodyStart(turned, aligned.angular_velocity), aligned.time
    )


def _slow_to_pinch(kappa: float, slow_times: np.ndarray) -> tuple[Run, float]:
    """The averaged run, L_x = L_y = 0 exactly, as far as the pinch point, and the slow time at which it is met."""
    body = spheroid(kappa)
    momentum, energy = _scene(kappa, 1.0).initial.slow[0, 2:] / max(body.inertia)
    return slow_run_to_pinch(body, (0.0, 0.0, momentum, energy), slow_times)


def _least_momentum(
    kappa: float, stokes: float, phi: float, slow_time: float, form: str = "hybrid"
) -> float:
    """Smallest |L|/I_max of a run that starts with L along the vorticity."""
    speed = MOMENTUM / slow_time
    half = min(slow_time, max(WINDOW, 10 / sqrt(stokes)) / speed)
    times = np.concatenate([[0.0], stokes * (slow_time + half * np.linspace(-0.999, 2.0, 12001))])
    run = run_form(find_form(form), _scene(kappa, stokes, phi, times[-1] / stokes), times, 1e-10)
    squares = np.sum(run.slow[:, :3] ** 2, axis=1)
    # L passes its smallest value on a straight line, and |L|² so on a parabola, whose vertex lies
    # between samples.
    place = int(np.clip(np.argmin(squares), 1, len(squares) - 2))
    before, least, after = squares[place - 1 : place + 2]
    return sqrt(max(0.0, least - (after - before) ** 2 / (8 * (before - 2 * least + after))))


def growth_exponent(kappa: float) -> float:
    """Exponent e with which a small L_y of a prolate spheroid grows like L_z^e on its way to the pinch point."""
    # There h = cos θ_LO → 1, as Y_c > X_c, and dL_z/dt₂ → -4πX_c: by `lysmain` e = (X_c + Y_c
    # I_a/I_e - 2Y_c)/X_c.
    axial, equatorial = spheroid(kappa).resistance[2], spheroid(kappa).resistance[0]
    return (
        axial + equatorial * Spheroid.of(spheroid(kappa)).inertia_ratio - 2 * equatorial
    ) / axial


def pinch_exponent(kappa: float) -> float:
    """Exponent in St of the smallest |L| of a prolate spheroid on its way past the pinch point."""
    # What is left of the O(1/St) oscillation in L_y reaches L_z when L_z^(1 - e) is of order 1/St.
    return -1 / (1 - growth_exponent(kappa))


def local_exponent(found: Table, low: float, high: float) -> float:
    """Exponent of the smallest |L| between two St."""
    stokes, mean = root_mean_squares(found, "stokes", "least")
    chosen = (stokes >= 0.99 * low) & (stokes <= 1.01 * high)
    return exponent(stokes[chosen], mean[chosen])


def widest() -> float:
    """The aspect ratio with the width St^-1/2."""
    return float(brentq(lambda kappa: growth_exponent(kappa) + 1, 1.1, 3.0))  # pyright: ignore[reportArgumentType]
