"""The second-order averaged triaxial ellipsoid: its averages, its orders, where it refuses."""

from math import pi

import numpy as np
import pytest
from observed import observed

from polhode.harness.references.errors import errors
from polhode.models.catalogue import form
from polhode.models.form import FormNotValidError
from polhode.models.forms import averaged
from polhode.models.operations import FLOAT
from polhode.models.scene import BodyStart, EulerStart, Scene
from polhode.models.second_order import tables as second_order_triaxial
from polhode.models.second_order.averages import averages
from polhode.models.second_order.polhodes import Polhodes
from polhode.models.second_order.torus import Torus
from polhode.models.shape import Ellipsoid

NAME = "averaged-second-order"
PAPER = Ellipsoid((1.0, 0.8, 0.5))
POSE = (0.8, 0.3, -0.4, 0.2)
SIDES = pytest.mark.parametrize("longest", [False, True])

# From an implementation of the same averages by numerical differentiation, to its seven digits.
PUBLISHED = {
    "f": (-25.97696, -13.2443),
    "g": (-1.65912, 0.75633),
    "e": (-7.74932, 0.74854),
    "r": (-4.2231, 11.19859),
    "a": (-3.1212, -18.0174),
    "b": (-3.8246, -10.8796),
    "p": (-5.6029, 17.4763, -3.0901, 37.4151, 21.2601, -16.0088),
}
NAMES = {"f": ("f0", "f2"), "g": ("g0", "g2"), "e": ("ea", "eb")}


def test_averages_agree_with_an_independent_implementation():
    side = second_order_triaxial.side_of(PAPER, longest=False)
    y = np.log([0.3 / 0.7])
    found, residual = averages(side, y)
    slope = Polhodes(side, y, np.zeros(1), 2).slope[0]
    assert residual < 1e-12
    for letter, values in PUBLISHED.items():
        for i, value in enumerate(values):
            name = NAMES.get(letter, [f"{letter}{j + 1}" for j in range(6)])[i]
            per_h = slope if letter in "gb" else 1.0
            assert found[name][0] * per_h == pytest.approx(value, abs=6e-5), name


@SIDES
@pytest.mark.parametrize("y", [-6.0, -1.0, 2.0, 4.0])
def test_averages_are_functions_of_the_polhode_alone(longest, y):
    _, residual = averages(second_order_triaxial.side_of(PAPER, longest), np.array([y]))
    assert residual < 1e-9


@SIDES
@pytest.mark.parametrize("y", [-3.0, 0.5])
def test_first_order_is_the_averaged_form(longest, y):
    side = second_order_triaxial.side_of(PAPER, longest)
    found = {name: value[0] for name, value in averages(side, np.array([y]))[0].items()}
    polhode = Polhodes(side, np.array([y]), np.zeros(1), 2)
    unit, momentum = max(PAPER.inertia), np.array([0.3, -0.2, 0.25])
    size = np.linalg.norm(momentum)
    energy = 0.5 * polhode.h[0] * size**2
    rhs, p = averaged.field(FLOAT), averaged.coefficients(PAPER)
    expected = unit * np.array(rhs((*(momentum / unit), energy / unit), p))
    n = momentum / size
    strain, spin = 0.5 * np.array([n[1], n[0], 0]), 0.5 * np.array([n[1], -n[0], 0])
    growth = size * found["f0"] + found["f2"] * n[2] / 2
    rates = growth * n + np.cross(n, found["r1"] * strain + found["r2"] * spin)
    rate_h = polhode.slope[0] * (found["g0"] + found["g2"] * n[2] / 2 / size)
    assert rates == pytest.approx(expected[:3], rel=1e-11)
    assert size * growth * polhode.h[0] + 0.5 * size**2 * rate_h == pytest.approx(expected[3], rel=1e-11)


@SIDES
def test_torque_does_not_turn_the_body(longest):
    side = second_order_triaxial.side_of(PAPER, longest)
    polhode = Polhodes(side, np.array([-0.4]), np.array([0.7]), 48)
    flow = np.array([[2.0, -1, 2], [2, 2, -1]]) / 3
    torus = Torus(polhode, np.array([1.3]), np.array([0.2]), flow[:1], flow[1:])
    rates, size = torus.perturbation, 1.3
    z = polhode.z[:, :, None]
    turn = rates[..., 4:5] * (np.cross(polhode.along[:, :, None], z) + torus.turn_along[:, :, None, None] * z)
    turn = turn + rates[..., 3:4] * (np.cross(polhode.beside.z[:, :, None], z) + torus.turn_beside[..., None, None] * z)
    turn = np.einsum("mabij,mabj->mabi", torus.rotation, turn + rates[..., 5:] * z)
    tilt = np.stack([-rates[..., 1], rates[..., 0], 0 * rates[..., 0]], axis=-1) / size
    assert np.abs(turn + tilt).max() < 1e-11 * np.abs(turn).max()


STARTS = [
    ((1.0, 0.8, 0.5), (0.6, 0.5, 1.0)),
    ((0.5, 1.0, 0.8), (-1.2, 0.5, 0.4)),
    ((1.0, 0.6, 0.4), (0.1, 0.1, -0.8)),
    ((1.0, 0.8, 0.5), (1.5, 0.2, 0.1)),
]


@pytest.fixture(scope="module", params=STARTS)
def decade(request):
    """Errors and estimates at two Stokes numbers, against the full form."""
    axes, omega = request.param
    rows = []
    for stokes in (2e4, 2e5):
        scene = Scene(Ellipsoid(axes), stokes, BodyStart(POSE, omega), 0.03 * stokes)
        true = observed("quaternion", scene, tolerance=1e-16, samples=401)
        found = observed(NAME, scene, solver="dop853", tolerance=1e-12, samples=401)
        rows.append((errors(scene.ellipsoid, found, true), form(NAME).estimate(scene)))
    return rows


def test_orders(decade):
    (coarse, _), (fine, _) = decade
    assert np.log10(fine.slow / coarse.slow) < -1.85
    assert np.log10(fine.orientation / coarse.orientation) < -0.9


def test_it_knows_its_own_slow_error(decade):
    for error, estimate in decade:
        assert 1 < estimate.slow / error.slow < 10


def test_it_bounds_its_own_orientation_error(decade):
    for error, estimate in decade:
        assert error.orientation < estimate.orientation


@pytest.mark.parametrize(("axes", "omega"), STARTS)
def test_the_start_is_met(axes, omega):
    scene = Scene(Ellipsoid(axes), 1e4, BodyStart(POSE, omega), 100.0)
    found = form(NAME).observe(scene, np.array([form(NAME).problem(scene).start]))
    assert found.slow == pytest.approx(scene.initial.slow, abs=1e-12)
    assert found.rotation == pytest.approx(scene.initial.rotation, abs=1e-12)
    assert (form(NAME).orientation_of(scene), form(NAME).known_axes(scene)) == ("full", (0, 1, 2))


REFUSED = [
    ((1.0, 0.8, 0.5), EulerStart((pi / 3, pi / 6, 0.0), (1.0, 1.0, -1.0)), 0.1, "meets L² = 2EI₂"),
    ((1.0, 0.8, 0.5), BodyStart(POSE, (0.0, 0.0, -1.2)), 1e-3, "principal axis"),
]


@pytest.mark.parametrize(("axes", "start", "slow_time", "condition"), REFUSED)
def test_refusal_names_the_condition(axes, start, slow_time, condition):
    scene = Scene(Ellipsoid(axes), 1e5, start, slow_time * 1e5)
    with pytest.raises(FormNotValidError) as refusal:
        form(NAME).problem(scene)
    assert condition in refusal.value.condition
    assert refusal.value.instead == "quaternion"


def test_a_slow_start_beyond_the_separatrix_is_refused():
    """Started slowly at St = 87: the transformation throws the body to the other side of L² = 2EI₂."""
    start = BodyStart((-0.7210512, -0.3094284, 0.3362292, -0.5208543), (-0.003725, 0.007211, 0.00397))
    scene = Scene(Ellipsoid((0.401, 0.195, 1.0)), 87.0, start, 2.44)
    with pytest.raises(FormNotValidError, match="too small for this start"):
        form("averaged-second-order").problem(scene)
