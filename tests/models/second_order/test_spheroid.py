"""The second-order averaged spheroid: its averages, its orders, its own estimate, its refusals."""

import importlib.util
from fractions import Fraction
from math import inf, pi, prod
from pathlib import Path

import numpy as np
import pytest
from observed import observed

from polhode.harness.references.errors import errors
from polhode.models.catalogue import form, full_form
from polhode.models.form import FormNotValidError
from polhode.models.forms import averaged_spheroid, spheroid_axis
from polhode.models.forms.spheroid import Spheroid
from polhode.models.operations import FLOAT
from polhode.models.scene import BodyStart, EulerStart, Scene, SlowStart
from polhode.models.second_order import spheroid as second_order_spheroid
from polhode.models.shape import Ellipsoid
from polhode.solvers.solve import solve

NAME = "averaged-second-order"
START = EulerStart((pi / 3, pi / 6, 0.0), (1.0, 1.0, 1.0))
OTHER = EulerStart((1.0, 0.3, 0.2), (-1.0, 0.5, -2.0))
SHAPES = pytest.mark.parametrize("axes", [(1, 1, 2), (1, 1, 0.5), (1, 4, 1), (0.1, 1, 1)])
# One slow state: L over I_e and the axis.
STATE = np.array([0.6, -0.3, 0.8, 2 / 3, 1 / 3, -2 / 3])


@pytest.fixture(scope="module")
def derivation():
    path = Path(__file__).parents[3] / "docs" / "derivations" / "spheroid_second_order.py"
    spec = importlib.util.spec_from_file_location("spheroid_second_order", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_coefficients_are_the_derived_ones(derivation):
    values = {"D": Fraction(3), "d": Fraction(5), "c": Fraction(-7), "k": Fraction(11)}
    typed = second_order_spheroid.coefficient_polynomials(
        {name: float(value) for name, value in values.items()}
    )
    for name, polynomial in derivation.coefficients().items():
        for h in (Fraction(1, 3), Fraction(-2, 5), Fraction(7, 8)):
            exact = sum(
                coefficient
                * np.prod(
                    [
                        {**values, "h": h}[n] ** k
                        for n, k in zip(derivation.NAMES, powers, strict=True)
                        if k
                    ]
                )
                for powers, coefficient in polynomial.terms.items()
            )
            short = name.removeprefix("r2 ")
            ours = sum(value * float(h) ** (2 * power) for power, value in enumerate(typed[short]))
            if name[0] in "gb":
                ours *= float(h - h**3)
            if short == "e":
                ours *= float(1 - h * h)
            assert ours == pytest.approx(float(exact), rel=1e-14, abs=1e-14), name


def evaluate(polynomial, names, values):
    """Exact value of a polynomial of the derivation."""
    factors = [
        coefficient
        * prod(values[name] ** power for name, power in zip(names, powers, strict=True) if power)
        for powers, coefficient in polynomial.terms.items()
    ]
    return sum(factors)


def brute_force(axes):
    """B_s(w), u_s(w) of the interaction picture, from the full field alone, averages and integrals by sums over s."""
    spheroid = Spheroid.of(Ellipsoid(axes))
    rhs, p = spheroid_axis.field(FLOAT), (1.0, 1.0, *spheroid_axis.parameters(spheroid))
    nodes = 2 * pi * np.arange(16) / 16

    def rotate(n, s, v):
        return n * (n @ v) + np.cos(s) * (v - n * (n @ v)) + np.sin(s) * np.cross(n, v)

    def pulled(w, s):
        size = np.linalg.norm(w[:3])
        n = w[:3] / size
        rate = np.array(rhs((*w[:3], *rotate(n, s, w[3:])), p)[:3]) / size
        tilt = (rate - n * (n @ rate)) / size
        return np.concatenate(
            [rate, -np.cross(np.sin(s) * tilt - (1 - np.cos(s)) * np.cross(n, tilt), w[3:])]
        )

    def generator(w, s):
        spectrum = np.fft.fft([pulled(w, node) for node in nodes], axis=0) / 16
        return sum((spectrum[k] * np.exp(1j * k * s) / (1j * k)) for k in range(-7, 8) if k).real

    return spheroid, nodes, pulled, generator


def lean(rates):
    """Rate of h = n·q."""
    size = np.linalg.norm(STATE[:3])
    n = STATE[:3] / size
    return rates[:3] @ (STATE[3:] - n * (n @ STATE[3:])) / size + n @ rates[3:6]


@SHAPES
def test_averages_agree_with_brute_force(axes):
    spheroid, nodes, pulled, generator = brute_force(axes)
    size = np.linalg.norm(STATE[:3])
    first = size * np.mean([pulled(STATE, s) for s in nodes], axis=0)
    change = []
    for s in nodes:
        u = generator(STATE, s)
        step = 1e-5 * u / np.linalg.norm(u)
        change.append(
            (pulled(STATE + step, s) - pulled(STATE - step, s)) * np.linalg.norm(u) / 2e-5
        )
    second = size * np.mean(change, axis=0)
    rhs = second_order_spheroid.field(FLOAT)
    ours = np.array(rhs((*STATE, 0.0), second_order_spheroid.parameters(spheroid, 0.0)))
    both = np.array(rhs((*STATE, 0.0), second_order_spheroid.parameters(spheroid, 1.0)))
    assert ours[:6] == pytest.approx(first, rel=1e-12, abs=1e-12)
    assert (both - ours)[:3] == pytest.approx(second[:3], rel=1e-6)
    assert lean(both - ours) == pytest.approx(lean(second), rel=1e-6)
    assert both[6] == pytest.approx(size, rel=1e-15)


@SHAPES
def test_generator_agrees_with_brute_force(axes):
    spheroid, _, _, generator = brute_force(axes)
    *ours, axis = second_order_spheroid.generator(spheroid, STATE[:3].tolist(), STATE[3:].tolist())
    assert axis == pytest.approx(STATE[3:], abs=1e-15)
    assert np.concatenate(ours) == pytest.approx(generator(STATE, 0.0), rel=1e-12, abs=1e-12)


@SHAPES
def test_the_size_of_the_transformation_is_the_largest_at_six_turns(axes):
    spheroid, momentum, h = Spheroid.of(Ellipsoid(axes)), STATE[:3], 0.6
    size = np.linalg.norm(momentum)
    n = momentum / size
    # The second component of L is the least.
    axis = h * n + np.sqrt(1 - h * h) * np.cross(n, [0, 1, 0]) / np.linalg.norm(
        np.cross(n, [0, 1, 0])
    )
    energy = (
        spheroid.equatorial_inertia * size**2 * (1 + (1 / spheroid.inertia_ratio - 1) * h * h) / 2
    )
    found, _ = second_order_spheroid.orders(
        spheroid, 1e-3, np.array([[*spheroid.equatorial_inertia * momentum, energy]])
    )
    every = []
    for turn in pi / 3 * np.arange(6):
        change, tilt, _ = second_order_spheroid.generator(
            spheroid, momentum, axis, np.cos(turn), np.sin(turn)
        )
        every.append(np.linalg.norm(change) / size + np.linalg.norm(tilt))
    assert found == pytest.approx([1e-3 * max(every)], rel=1e-12)


@SHAPES
def test_without_second_order_it_is_the_averaged_spheroid(axes):
    spheroid = Spheroid.of(Ellipsoid(axes))
    ours = second_order_spheroid.field(FLOAT)(
        (*STATE, 0.0), second_order_spheroid.parameters(spheroid, 0.0)
    )
    spin = STATE[:3] @ STATE[3:] / spheroid.inertia_ratio
    p = (spheroid.inertia_ratio, spheroid.axial_damping, spheroid.equatorial_damping)
    theirs = averaged_spheroid.field(FLOAT)((*STATE[:3], spin), p)
    assert ours[:3] == pytest.approx(theirs[:3], rel=1e-13)
    along = np.array(ours[:3]) @ STATE[3:] + STATE[:3] @ np.array(ours[3:6])
    assert along / spheroid.inertia_ratio == pytest.approx(theirs[3], rel=1e-13)


@pytest.fixture(
    scope="module", params=[((1, 1, 0.1), START), ((1, 2, 1), START), ((4, 1, 1), OTHER)]
)
def decade(request):
    """Errors and estimates at two Stokes numbers, against the full form."""
    axes, start = request.param
    rows = []
    for stokes in (2e4, 2e5):
        scene = Scene(Ellipsoid(axes), stokes, start, 0.05 * stokes)
        true = observed("spheroid-axis", scene, tolerance=1e-16, samples=501)
        found = observed(NAME, scene, solver="cyrk-dop853", tolerance=1e-15, samples=501)
        rows.append((errors(scene.ellipsoid, found, true), form(NAME).estimate(scene)))
    return rows


def test_orders(decade):
    (coarse, _), (fine, _) = decade
    assert np.log10(fine.slow / coarse.slow) == pytest.approx(-2, abs=0.1)
    assert np.log10(fine.orientation / coarse.orientation) == pytest.approx(-1, abs=0.1)


def test_it_bounds_its_own_error(decade):
    for error, estimate in decade:
        assert 1 < estimate.slow / error.slow < 40
        assert estimate.orientation / error.orientation > 1


@pytest.mark.parametrize("axes", [(0.32, 0.32, 1), (1, 0.6, 0.4)])
def test_it_bounds_the_energy_of_a_fast_spinner(axes):
    """The energy errs by the angular velocity times what L does, and the damping changes L faster than the swing."""
    scene = Scene(Ellipsoid(axes), 1e4, BodyStart((0.8, 0.3, -0.4, 0.2), (36.8, 4.0, -10.0)), 4.0)
    true = observed(full_form(scene), scene, tolerance=1e-16)
    found = errors(
        scene.ellipsoid, observed(NAME, scene, solver="cyrk-dop853", tolerance=1e-14), true
    )
    assert found.slow == found.slow_each[3] > 3 * max(found.slow_each[:3])
    assert 1 < form(NAME).estimate(scene).slow / found.slow < 40


@pytest.mark.parametrize("axes", [(0.46, 0.46, 0.33), (0.3, 0.3, 0.17)])
def test_it_bounds_the_swing_of_a_body_that_settles(axes):
    """What the transformation leaves out is its own change in a radian, far more than its square."""
    scene = Scene(Ellipsoid(axes), 1e3, BodyStart((1.0, 0.01, 0.0, 0.0), (0.0, 0.0, -0.5)), 500.0)
    true = observed(full_form(scene), scene, tolerance=1e-16)
    found = errors(
        scene.ellipsoid, observed(NAME, scene, solver="cyrk-dop853", tolerance=1e-14), true
    )
    assert 1 < form(NAME).estimate(scene).slow / found.slow < 10


@pytest.mark.parametrize("stokes", [200.0, 1e4, 1e8])
@pytest.mark.parametrize("axes", [(1, 1, 2), (1, 0.5, 1)])
def test_the_start_is_met(axes, stokes):
    scene = Scene(Ellipsoid(axes), stokes, OTHER, 1e-3 * stokes)
    equations = form(NAME)
    found = equations.observe(scene, np.array([equations.problem(scene).start]))
    assert found.slow == pytest.approx(scene.initial.slow, abs=1e-14)
    axis = scene.ellipsoid.symmetry_axis
    assert found.rotation[0, axis] == pytest.approx(scene.initial.rotation[0, axis], abs=1e-14)
    assert np.isnan(np.delete(found.rotation[0], axis, axis=0)).all()


@pytest.mark.parametrize("rate", [1.0, -0.8])
def test_spin_along_the_axis_is_no_singularity(rate):
    scene = Scene(Ellipsoid((1, 1, 2)), 1e4, EulerStart((1.0, 0.3, 0.0), (0.0, 0.0, rate)), 500.0)
    full, ours = (
        observed("spheroid-axis", scene),
        observed(NAME, scene, solver="cyrk-dop853", tolerance=1e-13),
    )
    estimate = form(NAME).estimate(scene)
    error = errors(scene.ellipsoid, ours, full)
    assert error.slow < estimate.slow < 0.01
    assert error.orientation < min(0.1, estimate.orientation)


def test_the_cost_does_not_depend_on_stokes():
    steps = []
    for stokes in (1e4, 1e8):
        problem = form(NAME).problem(Scene(Ellipsoid((1, 1, 2)), stokes, START, 0.5 * stokes))
        steps.append(solve(problem, "cyrk-dop853", 1e-10).work.steps)
    assert steps[1] == pytest.approx(steps[0], rel=0.2)


SPHEROID = Ellipsoid((1, 1, 2))
REFUSED = [
    (Ellipsoid((1, 1, 1)), 1e3, START, "sphere", "spheroid-axis"),
    (SPHEROID, 0.0, START, "St = 0", "jeffery"),
    (SPHEROID, inf, START, "St = inf", "euler-top"),
    (SPHEROID, 1e3, SlowStart((0.1, 0.1, -0.2), 0.2), "no orientation", "averaged-spheroid"),
    (SPHEROID, 1e3, EulerStart((1.0, 0.0, 0.0)), "L = 0", "spheroid-axis"),
    (SPHEROID, 3.0, START, "too small", "spheroid-axis"),
    (Ellipsoid((1, 1, 10)), 1e3, START, "too small", "spheroid-axis"),
    (
        SPHEROID,
        1e3,
        BodyStart((1.0, 0.0, 0.0, 0.0), (1e-4, 0.0, 1e-4)),
        "too small",
        "spheroid-axis",
    ),
]


@pytest.mark.parametrize(("ellipsoid", "stokes", "start", "condition", "instead"), REFUSED)
def test_refusal_names_the_condition_and_a_form_that_accepts(
    ellipsoid, stokes, start, condition, instead
):
    scene = Scene(ellipsoid, stokes, start, 100.0)
    with pytest.raises(FormNotValidError) as refusal:
        form(NAME).problem(scene)
    assert condition in refusal.value.condition
    assert refusal.value.instead == instead
    form(instead).check(scene)


@pytest.mark.parametrize(
    ("axes", "stokes", "start", "slow_time"),
    [
        (
            (1, 1, 0.6232895499854985),
            95480.0,
            EulerStart((1.74165, 2.31427, 0.0), (0.02373, 0.61645, 0.0335)),
            0.128,
        ),
        ((1, 1, 2), 1e5, EulerStart((pi / 2, 0.0, 0.0), (0.0, 1.0, 0.0)), 0.2),
    ],
)
def test_a_run_through_small_momentum_is_followed_short_of_it(axes, stokes, start, slow_time):
    """Such runs err by 0.03 and more at any St: L falls to 0 and turns over."""
    scene = Scene(Ellipsoid(axes), stokes, start, slow_time * stokes)
    with pytest.raises(FormNotValidError, match="too small for"):
        form(NAME).problem(scene)
    short = Scene(Ellipsoid(axes), stokes, start, form(NAME).reach(scene) * stokes)
    found, true = (
        observed(NAME, short, solver="cyrk-dop853", tolerance=1e-12),
        observed("spheroid-axis", short),
    )
    assert errors(short.ellipsoid, found, true).slow < form(NAME).estimate(short).slow < 0.1
