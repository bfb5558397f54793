"""Resonances between polhode and precession: the modes left in the field, what the masks cost, treated runs."""

from dataclasses import replace

import numpy as np
import pytest
from observed import observed

from polhode.harness.references.errors import errors
from polhode.models.catalogue import form
from polhode.models.form import FormNotValidError
from polhode.models.operations import FLOAT
from polhode.models.scene import BodyStart, Scene
from polhode.models.second_order import resonance
from polhode.models.second_order import run as second_order_run
from polhode.models.second_order import tables as second_order_triaxial
from polhode.models.second_order.averages import second_order
from polhode.models.second_order.field import SlowField
from polhode.models.second_order.polhodes import Polhodes, SidedBody
from polhode.models.second_order.tables import Pose
from polhode.models.second_order.torus import Mask, Torus
from polhode.models.shape import Ellipsoid
from polhode.solvers.solve import solve

NAME = "averaged-second-order"
PAPER = Ellipsoid((1.0, 0.8, 0.5))
POSE = (0.8, 0.3, -0.4, 0.2)
MODES = pytest.mark.parametrize("k", [(-3, 1), (-4, 2), (-5, 3)])
SIDES = pytest.mark.parametrize("longest", [False, True])
RESONANT = ((1.0, 0.8, 0.5), (0.6, 0.5, 0.5), 0.1, (-3, 1))
# The frame of L in space, as columns.
FRAME = np.array([[2.0, -1, 2], [2, 2, -1], [-1, 2, 2]]) / 3


def scene_of(axes, omega, stokes, slow_time):
    return Scene(Ellipsoid(axes), stokes, BodyStart(POSE, omega), slow_time * stokes)


@SIDES
@MODES
def test_field_holds_the_modes_share_of_the_torque(longest, k):
    side, y, unit, stokes = second_order_triaxial.side_of(PAPER, longest), 0.5, max(PAPER.inertia), 100.0
    a2 = float(np.log1p(np.exp(y)))
    alpha, beta, size = 0.7, -1.1, 0.8
    polhode = Polhodes(side, np.array([y]), np.array([alpha]), 64)
    torus = Torus(polhode, np.array([size]), np.array([beta]), FRAME[:1], FRAME[1:2])
    divisor = k[0] * polhode.rate[0] + k[1] * polhode.precession[0]
    mask = Mask(*k, abs(divisor) / 0.8)
    share = 1 - mask.inverses(divisor)[1] * divisor**2
    expected = 2 * share * torus.spectrum[0, k[0], k[1]].real

    low, high = 0.9 * a2, 1.1 * a2
    found = resonance.mode_table(PAPER, longest, mask, low, high)
    table = second_order_triaxial.table(PAPER, longest, low, high)
    p = second_order_triaxial.parameters(PAPER, 1 / stokes, table)
    both = (*p, *resonance.mode_parameters(PAPER, 1 / stokes, mask, found, (0.3, 0.4)))
    phases = ((alpha - 0.3) / stokes, (beta - 0.4) / stokes)
    state = (*(size / unit * FRAME[:, 2]), np.sqrt(a2), *FRAME[:, 0], *phases)

    gained = np.array(SlowField(32, 1)(FLOAT)(state, both)) - np.array(SlowField(32)(FLOAT)(state, p))
    rate_y = 2 * gained[3] * np.sqrt(a2) / -np.expm1(-a2)
    assert found.residual < 1e-7
    assert 0.1 < share < 0.9
    close = pytest.approx
    largest = np.abs(expected).max()
    assert unit * FRAME.T @ gained[:3] == close(expected[:3], abs=1e-7 * largest)
    assert rate_y == close(expected[3], abs=1e-7 * largest)
    assert stokes * gained[7:] == close(expected[4:], abs=1e-7 * largest)


@pytest.mark.parametrize("k", [(-1, 1), (0, 2)])
def test_masked_average_is_that_of_the_exact_bracket(k):
    """F₂ = ⟨U·∂P - F₁·∂U⟩ with F₁ = μP in the masked mode, by differences of U along F₁, here of a strong mode."""
    side, y, size, step = second_order_triaxial.side_of(PAPER, longest=False), 0.3, 1.2, 1e-3
    polhode = Polhodes(side, np.array([y]), np.zeros(1), 48)
    divisor = k[0] * polhode.rate[0] + k[1] * polhode.precession[0]
    mask = Mask(*k, abs(divisor) / 0.9)
    torus = Torus(polhode, np.array([size]), np.zeros(1), FRAME[:1], FRAME[1:2], (mask,))
    share = 1 - mask.inverses(divisor)[1] * divisor**2
    kept = np.zeros_like(torus.spectrum)
    for sign in (1, -1):
        kept[:, sign * k[0], sign * k[1]] = share * torus.spectrum[:, sign * k[0], sign * k[1]]
    pull, turn = (each.reshape(-1, 3) for each in torus.along(np.fft.ifft2(kept, axes=(1, 2), norm="forward").real))

    def generator(distance):
        momentum = (np.array([0, 0, size]) + distance * pull) @ FRAME.T
        rotation = FRAME @ second_order_triaxial.rotation_by(distance * turn) @ torus.rotation[0].reshape(-1, 3, 3)
        q = second_order_triaxial.frame(momentum, np.broadcast_to(FRAME[:, 0], momentum.shape))
        y, alpha, beta = second_order_triaxial.coordinates(side, Pose(momentum, rotation), q)
        there = second_order_triaxial.torus_at(side, momentum, q, y, alpha, beta, (mask,))
        return np.einsum("mij,mj->mi", q, there.ambient_here[0])

    change = (8 * (generator(step) - generator(-step)) - generator(2 * step) + generator(-2 * step)) / (12 * step)
    exact = second_order(torus)[0, :3] - FRAME.T @ change.mean(axis=0)
    plain = second_order(Torus(polhode, np.array([size]), np.zeros(1), FRAME[:1], FRAME[1:2]))[0, :3]
    ours = second_order(Torus(polhode, np.array([size]), np.zeros(1), FRAME[:1], FRAME[1:2], (mask,), averaging=True))
    assert np.abs(exact - plain).max() > 1e-2 * np.abs(plain).max()
    assert ours[0, :3] == pytest.approx(exact, abs=1e-7 * np.abs(plain).max())


def test_masks_never_divide_by_a_small_divisor():
    mask, divisor = Mask(-3, 1, 0.2), np.array([0.0, 1e-200, 1e-9, 1e-3, 0.1, 0.2, 1.0, 1e3])
    for inverses in (mask.inverses(divisor), mask.mean_inverses(divisor)):
        assert np.all(np.isfinite(inverses))
        assert np.abs(inverses[0]).max() < 2 / mask.width
        assert np.abs(inverses[1:]).max() < 2 / mask.width**2
        assert inverses[:, -1] == pytest.approx([1e-3, 1e-6, 1e-6], rel=1e-12)


@pytest.fixture(scope="module")
def decade():
    """Errors of second and first order, the predicted kick and the estimate of a resonant run, St a decade apart."""
    axes, omega, slow_time, mode = RESONANT
    rows = []
    for stokes in (1e4, 1e5):
        scene = scene_of(axes, omega, stokes, slow_time)
        treated = second_order_run.prepared(scene).treated
        assert [(each.mask.k1, each.mask.k2) for each in treated] == [mode]
        true = observed("quaternion", scene, tolerance=1e-16, samples=201)
        found = observed(NAME, scene, solver="dop853", tolerance=1e-11, samples=201)
        first = observed("averaged", scene, solver="dop853", tolerance=1e-11, samples=201)
        error = errors(scene.ellipsoid, found, true)
        rough = errors(scene.ellipsoid, first, true).slow
        rows.append((error, rough, treated[0].kick, form(NAME).estimate(scene)))
    return rows


def test_treated_runs_keep_the_orders(decade):
    (coarse, *_), (fine, *_) = decade
    assert np.log10(fine.slow / coarse.slow) < -1.85
    assert np.log10(fine.orientation / coarse.orientation) < -0.9


def test_treated_runs_beat_first_order_and_the_kick(decade):
    error, first, kick, _ = decade[1]
    assert error.slow < first / 20
    assert error.slow < kick / 10


def test_treated_runs_know_their_error(decade):
    for error, _, _, estimate in decade:
        assert 1 < estimate.slow / error.slow < 10
        assert error.orientation < estimate.orientation


def test_predicted_kick_is_what_the_mode_does():
    """Without the mode in field and transformation, what it gives L is missing."""
    axes, omega, slow_time, _ = RESONANT
    scene = scene_of(axes, omega, 1e5, slow_time)
    equations = form(NAME)
    problem, run = equations.problem(scene), second_order_run.prepared(scene)
    averaged = second_order_triaxial.parameters(scene.ellipsoid, scene.torque_factor, run.table)
    bare = replace(problem, field=SlowField(run.field.nodes), parameters=averaged)
    times = np.linspace(0, problem.end, 201)
    whole, part = (equations.observe(scene, solve(each, "dop853", 1e-10, times).states) for each in (problem, bare))
    kick = np.linalg.norm(whole.slow[-1, :3] - part.slow[-1, :3]) / max(scene.ellipsoid.inertia)
    assert 0.2 < kick / run.treated[0].kick < 1.2


def test_predicted_kick_falls_like_the_root_of_stokes():
    kicks = []
    for stokes in (1e4, 1e6):
        scene = scene_of((1.0, 0.6, 0.4), (0.5, -0.4, -1.2), stokes, 0.05)
        side = SidedBody.of(scene.ellipsoid, np.array([0.5, -0.4, -1.2]) * scene.ellipsoid.inertia)
        path, squares = second_order_run.first_order_path(scene)
        found = resonance.resonances(scene, side, path, squares.min(), squares.max())
        kicks.append(next(each.kick for each in found if (each.mask.k1, each.mask.k2) == (-4, 2)))
    assert kicks[0] / kicks[1] == pytest.approx(10, rel=1e-6)


def test_refusal_names_the_resonance_and_its_kick(monkeypatch):
    monkeypatch.setattr(second_order_run, "MOST_MODES", 0)
    second_order_run.prepared.cache_clear()
    with pytest.raises(FormNotValidError, match=r"\(-4, 2\) near t₂ = 0\.029\d? would kick L by 2\.\de-06 I_max"):
        form(NAME).problem(scene_of((1.0, 0.6, 0.4), (0.5, -0.4, -1.2), 1e5, 0.0499))


def test_reach_ends_short_of_the_separatrix():
    scene = scene_of((1.0, 0.8, 0.5), (0.8, 0.5, 0.3), 1e5, 0.1)
    with pytest.raises(FormNotValidError, match=r"meets L² = 2EI₂ near t₂ = 0\.0686"):
        form(NAME).check(scene)
    reach = form(NAME).reach(scene)
    assert 0.9 * 0.0686 < reach < 0.0686
    form(NAME).check(scene_of((1.0, 0.8, 0.5), (0.8, 0.5, 0.3), 1e5, reach))


def test_reach_of_a_run_on_one_side_is_its_end():
    axes, omega, slow_time, _ = RESONANT
    assert form(NAME).reach(scene_of(axes, omega, 1e5, slow_time)) == slow_time
