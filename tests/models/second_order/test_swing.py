"""The fast generator of the transformation against that over the whole torus."""

import numpy as np
import pytest
from scipy.integrate import simpson

from polhode.models.second_order import swing as swing_module, tables
from polhode.models.second_order.averages import phases
from polhode.models.second_order.extent import extent
from polhode.models.second_order.polhodes import Polhodes
from polhode.models.second_order.swing import Place, frame, frame_of, modes_at, series_for, tails
from polhode.models.second_order.torus import Torus
from polhode.models.shape import Ellipsoid

MANY = 12


@pytest.mark.parametrize("longest", [True, False])
@pytest.mark.parametrize("axes", [(1.0, 0.8, 0.5), (0.3, 1.0, 0.9), (0.2, 0.19, 1.0)])
def test_pose_and_generator_are_those_of_the_torus(
    axes: tuple[float, float, float], longest: bool, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(swing_module, "MOST_FAINT", swing_module.LEAST_FAINT)
    series, draw = series_for(Ellipsoid(axes), longest), np.random.default_rng(3)
    # From rotation about a principal axis to near L² = 2EI₂.
    for least, most, tolerance in ((1e-8, 1e-6, 1e-9), (0.01, 1.0, 1e-7), (3.0, 5.0, 1e-4)):
        a2, size = draw.uniform(least, most, MANY), draw.uniform(0.2, 2.0, MANY)
        alpha, beta = draw.uniform(0, 2 * np.pi, (2, MANY))
        frames = np.linalg.qr(draw.normal(size=(MANY, 3, 3)))[0]
        frames *= np.linalg.det(frames)[:, None, None]
        y = tables.level(a2)
        polhode = Polhodes(series.side, y, alpha, phases(series.side, float(y.max())))
        torus = Torus(polhode, size, beta, frames[:, 0], frames[:, 1])
        place = Place(series, a2, alpha, polhode.z[:, 0])
        q = frame(frames[:, :, 2], frames[:, :, 0], beta + place.shape[:, 0])
        assert np.abs(q @ place.body - frames @ torus.rotation[:, 0, 0]).max() < 1e-12
        for found, whole in zip(place.swing(q, size, 1e-12), torus.ambient, strict=True):
            exact = np.einsum("mij,jm->mi", frames, np.array(whole)[..., 0, 0])
            assert np.abs(found / 1e-12 - exact).max() < tolerance * np.abs(exact).max()


def test_a_mode_near_its_resonance_is_its_integral_from_afar():
    r = np.linspace(0, 60, 60001)
    for q in (1.0, -0.3):
        for x in (-30.0, -6.0, -5.0, -1.0, -1e-9, 1e-9, 0.4, 7.0):
            # Along σ = ∓r e^(iπ/4), where exp i(xσ + qσ²/2) falls like a Gaussian.
            way = (1 if x * q > 0 else -1) * np.exp(0.25j * np.pi * np.sign(q))
            wave = np.exp(1j * (x * way * r + q * (way * r) ** 2 / 2))
            once, twice = (-1j * way * simpson(each, x=r) for each in (wave, 1j * way * r * wave))
            found = tails(np.array([x]), np.array([q]))
            assert found[1][0] == pytest.approx(once, rel=1e-5)
            assert found[0][0] == pytest.approx(-twice, rel=1e-5)


@pytest.mark.parametrize("longest", [True, False])
def test_modes_are_those_of_the_torus(longest: bool):
    series, draw = series_for(Ellipsoid((1.0, 0.8, 0.5)), longest), np.random.default_rng(5)
    k1, k2 = np.array([[-3, 1], [-1, 1], [-4, 2], [-2, 2], [-5, 3], [-1, 3]]).T
    a2, momentum = draw.uniform(0.05, 2.0, len(k1)), draw.normal(size=(len(k1), 3))
    size, q, zero = np.linalg.norm(momentum, axis=1), frame_of(momentum), np.zeros(len(k1))
    y = tables.level(a2)
    polhode = Polhodes(series.side, y, zero, phases(series.side, float(y.max())))
    spectrum = Torus(polhode, size, zero, q[:, 0], q[:, 1]).spectrum[:, np.arange(len(k1)), k1, k2]
    strength, along, rise = modes_at(series, momentum, a2, k1, k2)
    assert np.abs(strength / np.linalg.norm(spectrum[:3], axis=0) - 1).max() < 1e-6
    for found, exact in ((along, spectrum[2]), (rise, spectrum[3])):
        assert np.abs(found - exact.conj()).max() < 1e-7 * np.abs(exact).max()


@pytest.mark.parametrize("longest", [True, False])
def test_the_size_is_the_root_mean_square_over_the_torus(longest: bool):
    body, draw = Ellipsoid((1.0, 0.8, 0.5)), np.random.default_rng(7)
    # Away from resonances.
    least, most = (0.6, 1.1) if longest else (0.1, 0.6)
    series, a2 = series_for(body, longest), np.tile(draw.uniform(least, most, MANY), 2)
    # L at random, and along the vorticity, where single tensors are left.
    momentum = np.concatenate([draw.normal(size=(MANY, 3)), -0.5 * np.eye(3)[[2] * MANY]])
    size, q, zero = np.linalg.norm(momentum, axis=1), frame_of(momentum), np.zeros(2 * MANY)
    polhode = Polhodes(series.side, tables.level(a2), zero, 48)
    change, turn = np.array(Torus(polhode, size, zero, q[:, 0], q[:, 1]).ambient)
    square = np.sum((change / size[:, None, None]) ** 2 + turn**2, axis=0).mean(axis=(1, 2))
    assert extent(body, longest, momentum, a2) == pytest.approx(np.sqrt(2 * square), rel=0.05)


def test_series_go_on_smoothly_where_a_run_steps_beyond_their_end():
    series, beyond = (
        series_for(Ellipsoid((1.0, 0.8, 0.5)), True),
        np.array([[-2e-3], [-1e-3], [1e-3], [2e-3]]),
    )
    a2, alpha = (swing_module.MAX_A2 + beyond).ravel(), np.full(4, 0.7)
    first, second, third, last = Place(series, a2, alpha, np.eye(3)[[2] * 4]).shape
    assert np.abs(last - first).max() > 1e-4
    assert np.abs((last - first) - 2 * (third - second)).max() < 1e-6
