"""Certificates of references: short pieces solved again by an unrelated method in another form, and back again."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from polhode.harness.balance import complete
from polhode.harness.errors import errors
from polhode.models.catalogue import form as find_form
from polhode.models.form import Form, FormNotValidError
from polhode.models.observables import Observables
from polhode.models.scene import BodyStart, Scene, SlowStart, Start
from polhode.models.shape import Ellipsoid
from polhode.solvers.solve import solve

# Pieces of a run, evenly spread over it; so many of them must be decided, none against the reference.
PIECES, REQUIRED = 24, 20
# Longest piece, in units of the inverse shear rate for full forms, and in slow time for averaged ones.
LONGEST = 500.0
# Going back amplifies by exp(max(8πX/I) Δt/St): pieces that go back keep the exponent below this.
LARGEST_EXPONENT = 5.0
# The other method's own error at the tight tolerance: what the loose one makes, ten times what an ulp in the start
# makes, and rounding of the numbers compared.
TOLERANCES = {"cyrk-vern8": (1e-13, 1e-12), "ida": (1e-12, 1e-11), "exact": (1e-15, 1e-15)}
ULPS, ROUNDING = 10.0, 2e-15

# Takes a state, its time and a duration, negative to go back, to the state then.
Flow = Callable[[np.ndarray, float, float], np.ndarray]


class UncertifiedError(RuntimeError):
    """A reference that an unrelated method contradicts, or that could not be tried often enough."""


@dataclass(frozen=True)
class Certificate:
    """What confirmed a reference.

    Parameters
    ----------
    form, solver : str
        Who solved the pieces again.
    pieces : int
        Pieces that agreed forwards, of `PIECES` tried; the others ran into the other form's singularity.
    back : int
        Pieces that agreed when the reference's own method went back over them.
    ratio : float
        Largest difference over the method's own error; at most 1.
    slow, orientation : float
        Largest differences met, over I_max and in rad.
    """

    form: str
    solver: str
    pieces: int
    back: int
    ratio: float
    slow: float
    orientation: float


@dataclass(frozen=True)
class Piece:
    """Times of a piece, in the form's own time: where it starts, ends, and ends if it is gone back over."""

    start: float
    end: float
    back: float


def pieces(scene: Scene, form: Form, end: float) -> list[Piece]:
    """Pieces evenly spread over a run from 0 to `end` in the form's own time."""
    length = min(end / PIECES, LONGEST)
    damping = max(scene.ellipsoid.damping) * (1.0 if form.averaged else min(scene.torque_factor, 1e300))
    short = length if damping * length < LARGEST_EXPONENT else 0.9 * LARGEST_EXPONENT / damping
    starts = np.arange(PIECES) * (end / PIECES)
    return [Piece(float(start), float(start + length), float(start + short)) for start in starts]


def certify(scene: Scene, form: Form, states: dict[float, np.ndarray], flow: Flow) -> Certificate:
    """Try a reference's states on pieces of its run.

    Parameters
    ----------
    scene : Scene
    form : Form
        The reference's.
    states : dict
        The reference's states, shape (d,), at the times of `pieces`.
    flow : callable
        The reference's own method, for going back.

    Raises
    ------
    UncertifiedError
        If a piece disagrees by more than the other method's own error, or fewer than `REQUIRED` could be tried.
    """
    end = max(states)
    other, solver = opposite(scene, form)
    seen = {time: form.observe(scene, state[None]) for time, state in states.items()}
    agreed, back, worst = 0, 0, np.zeros(3)
    for piece in pieces(scene, form, end):
        outcome = _forward(scene, form, (other, solver), seen[piece.start], seen[piece.end], piece.end - piece.start)
        if outcome is not None:
            agreed += 1
            worst = np.maximum(worst, outcome)
        if scene.stokes > 0:
            worst[0] = max(worst[0], _backward(scene, form, states, piece, flow))
            back += 1
        if worst[0] > 1:
            raise UncertifiedError(
                f"the reference of form {form.name!r} at St = {scene.stokes:g} differs from form {other!r} by "
                f"{solver} on the piece from {piece.start:g} to {piece.end:g}: {worst[0]:.1f} times the method's error"
            )
    if agreed < REQUIRED:
        raise UncertifiedError(f"only {agreed} of {PIECES} pieces could be tried, expected at least {REQUIRED}")
    return Certificate(other, solver, agreed, back, *worst.tolist())


def opposite(scene: Scene, form: Form) -> tuple[str, str]:
    """Another form and an unrelated method; averaged forms have no second form of their own."""
    if form.averaged:
        return form.name, "cyrk-vern8"
    spheroidal = scene.ellipsoid.kind in ("prolate", "oblate")
    if scene.stokes == 0:
        return ("jeffery", "exact") if scene.ellipsoid.kind != "triaxial" else ("euler-angles", "ida")
    return "spheroid-axis" if spheroidal else "euler-angles", "cyrk-vern8"


def restart(scene: Scene, observables: Observables, *, ulps: int = 0) -> Start:
    """Start from observables at one time; `ulps` moves the angular velocity, or L and E, by so many ulps."""
    moved = 1 + ulps * np.finfo(float).eps
    momentum = observables.angular_momentum[0].astype(float)
    rotation = complete(scene, observables)
    if rotation is None:
        x, y, z = (momentum * moved).tolist()
        return SlowStart((x, y, z), float(observables.energy[0]) * moved)
    w1, w2, w3 = (rotation[0] @ momentum / np.array(scene.ellipsoid.inertia) * moved).tolist()
    return BodyStart(_quaternion(rotation[0]), (w1, w2, w3))


def _forward(
    scene: Scene, form: Form, by: tuple[str, str], before: Observables, after: Observables, length: float
) -> np.ndarray | None:
    """Ratio of difference to own error, and differences, of a piece solved again; None where it cannot be solved.

    Euler angles are taken about the three body axes in turn, from the one farthest from their pole on.
    """
    axes = [2] if by[0] != "euler-angles" else np.argsort(np.abs(before.rotation[0, :, 2].astype(float))).tolist()
    best = None
    for axis in axes:
        turned = Scene(Ellipsoid(_turn(scene.ellipsoid.semi_axes, axis)), scene.stokes, scene.start, scene.time)
        time = length * form.problem(scene).time_unit
        starts = [restart(turned, _turned(before, axis), ulps=ulps) for ulps in (0, 1)]
        tight, loose = TOLERANCES[by[1]]
        try:
            runs = [
                _end(replace(turned, start=start, time=time), by, tolerance)
                for start, tolerance in ((starts[0], tight), (starts[1], tight), (starts[0], loose))
            ]
        except FormNotValidError:
            continue
        if any(run is None for run in runs):
            continue
        outcome = _compare(turned.ellipsoid, runs, _turned(after, axis))
        best = outcome if best is None or outcome[0] < best[0] else best
        if outcome[0] <= 1:
            break
    return best


def _compare(ellipsoid: Ellipsoid, runs: list, true: Observables) -> np.ndarray:
    """Ratio of difference to own error, slow difference, orientation difference."""
    tight, moved, *loose = runs
    found = errors(ellipsoid, tight, true)
    own = [(ULPS, errors(ellipsoid, moved, tight)), *((1.0, errors(ellipsoid, other, tight)) for other in loose)]
    size = max(1.0, float(np.max(np.abs(true.slow))) / max(ellipsoid.inertia))
    slow = sum(times * each.slow for times, each in own) + ROUNDING * size
    angle = sum(times * (each.orientation or 0.0) for times, each in own) + ROUNDING * size
    ratio = max(found.slow / slow, (found.orientation or 0.0) / angle)
    return np.array([ratio, found.slow, found.orientation or 0.0])


def _backward(scene: Scene, form: Form, states: dict[float, np.ndarray], piece: Piece, flow: Flow) -> float:
    """Ratio of the difference after going back over a piece to what an ulp at its end makes of it."""
    length = piece.back - piece.start
    at_end = states[piece.back]
    ulp = np.abs(at_end.astype(float)) * np.finfo(float).eps
    returned, moved = (flow(state, piece.back, -length) for state in (at_end, at_end + ulp))
    true, found, other = (form.observe(scene, state[None]) for state in (states[piece.start], returned, moved))
    return float(_compare(scene.ellipsoid, [found, other], true)[0])


def _end(scene: Scene, by: tuple[str, str], tolerance: float) -> Observables | None:
    form = find_form(by[0])
    solution = solve(form.problem(scene), by[1], tolerance)
    return form.observe(scene, solution.states[-1:]) if solution.success else None


def _turn(items: tuple, axis: int) -> tuple:
    """Cyclic renaming of the body axes that makes `axis` the third one."""
    return tuple(items[(axis + 1 + i) % 3] for i in range(3))


def _turned(observables: Observables, axis: int) -> Observables:
    order = list(_turn((0, 1, 2), axis))
    return replace(observables, rotation=observables.rotation[:, order])


def _quaternion(rotation: np.ndarray) -> tuple[float, float, float, float]:
    from scipy.spatial.transform import Rotation

    q0, q1, q2, q3 = Rotation.from_matrix(rotation.T).as_quat(scalar_first=True).tolist()
    return q0, q1, q2, q3


def expected_times(scene: Scene, form: Form, end: float) -> Iterator[float]:
    """Times at which `certify` wants states."""
    for piece in pieces(scene, form, end):
        yield from (piece.start, piece.back, piece.end)
    yield end
