"""Built-in scenes: those of the paper, and the hard cases on which forms and solvers are tried."""

from dataclasses import dataclass
from math import cos, inf, pi, sqrt

from polhode.models.rotation import Triple
from polhode.models.scene import BodyStart, EulerStart, Scene, Start
from polhode.models.shape import Ellipsoid


@dataclass(frozen=True)
class NamedScene:
    """A scene, and in one line what is hard about it."""

    summary: str
    scene: Scene


PAPER_ELLIPSOID = (1.0, 0.8, 0.5)
PAPER_START = EulerStart((pi / 3, pi / 6, 0.0), (1.0, 1.0, -1.0))
SPHEROID_START = EulerStart((pi / 3, pi / 6, 0.0), (1.0, 1.0, 1.0))
SADDLE_START = EulerStart((1.57, 0.0, pi / 2), (0.0, -0.61, 0.0003))
NEAR_POLE_START = EulerStart((3.14, 0.0, 0.0), (0.0, -0.4, 0.6))
PROLATE = (1.0, 1.0, 2.0)


def _scene(semi_axes: Triple, start: Start, stokes: float, *, time: float = 0.0, slow_time: float = 0.0) -> Scene:
    return Scene(Ellipsoid(semi_axes), stokes, start, time or slow_time * stokes)


def _vorticity_aligned(semi_axes: Triple, theta: float, precession: float) -> EulerStart:
    """Start with θ = theta, φ = 0 and L = I_e φ̇ ẑ of a spheroid with symmetry axis z', where φ̇ = precession."""
    equatorial, _, axial = Ellipsoid(semi_axes).inertia
    spin = precession * cos(theta) * (equatorial / axial - 1)
    return EulerStart((theta, 0.0, 0.0), (0.0, precession, spin))


def aligned_start(ellipsoid: Ellipsoid, momentum: float, theta: float, phi: float = 0.0) -> EulerStart:
    """Start with L = `momentum` ẑ: θ = theta, φ = phi, ψ = π/2.

    With ψ = π/2 the axis x' stands in the plane of z' and ẑ: φ̇₀ = L_z/I₁ and ψ̇₀ = L_z cos θ₀ (1/I₃ - 1/I₁), so that θ₀
    from 0 to π/2 covers all energies. The captions of the paper print these rates with ψ₀ = 0, to which I₂ belongs,
    and for spheroids the other sign of ψ̇₀.
    """
    i1, _, i3 = ellipsoid.inertia
    return EulerStart((theta, phi, pi / 2), (0.0, momentum / i1, momentum * cos(theta) * (1 / i3 - 1 / i1)))


SCENES: dict[str, NamedScene] = {
    "paper": NamedScene(
        "ellipsoid started on the long-axis side: crosses L² = 2EI₂",
        _scene(PAPER_ELLIPSOID, PAPER_START, 1e3, slow_time=0.5),
    ),
    "paper-saddle": NamedScene(
        "ellipsoid started close to the rotation about its longest axis, where it lingers",
        _scene(PAPER_ELLIPSOID, SADDLE_START, 1e3, slow_time=1.0),
    ),
    "spheroid": NamedScene("prolate spheroid, kappa = 2", _scene(PROLATE, SPHEROID_START, 1e3, slow_time=0.5)),
    "spheroid-near-pole": NamedScene(
        "kappa = 2 started at theta = 3.14: next to the Euler angles' pole, and lingering at the saddle",
        _scene(PROLATE, NEAR_POLE_START, 1e3, slow_time=0.5),
    ),
    "near-pole": NamedScene(
        "ellipsoid started at theta = 3.14, next to the Euler angles' pole",
        _scene(PAPER_ELLIPSOID, NEAR_POLE_START, 1e3, slow_time=0.5),
    ),
    "pinch-point": NamedScene(
        "L shrinks to 0 while L_z changes sign, where averaging breaks down",
        _scene(PROLATE, _vorticity_aligned(PROLATE, 1.0, 0.5), 1e3, slow_time=0.1),
    ),
    "top": NamedScene(
        "St = inf: the torque-free top",
        _scene((1.0, 2.0, 2.3), EulerStart((1.05, 0.0, 0.0), (2.5, 15.0, 4.0)), inf, time=100.0),
    ),
    **{
        f"rest-{name}": NamedScene(
            f"from rest at St = {name}: no separation of time scales before t = sqrt(St)",
            _scene((3.0, 2.0, 1.0), EulerStart((0.314, 0.52, 1.05)), float(name), time=20 * sqrt(float(name))),
        )
        for name in ("50", "500", "5e3", "5e4", "5e5")
    },
    "rest-spheroid": NamedScene(
        "spheroid of kappa = 2 from rest at St = 5e5",
        _scene(PROLATE, EulerStart((0.314, 0.52, 0.0)), 5e5, time=20 * sqrt(5e5)),
    ),
    "rest-1e8": NamedScene(
        "from rest at St = 1e8: angular velocities of 1e-4 over one transition time sqrt(St)",
        _scene((0.5, 0.55, 1.0), EulerStart((0.78539, 2.35619, 0.0)), 1e8, time=1e4),
    ),
    "needle": NamedScene(
        "kappa = 10 from rest: quick turns between long alignments with the flow",
        _scene((0.1, 0.1, 1.0), EulerStart((0.10472, 5.4978, 0.0)), 1e3, time=500.0),
    ),
    "needle-triaxial": NamedScene(
        "semi-axes 0.1, 0.15, 1 from rest",
        _scene((0.1, 0.15, 1.0), EulerStart((0.10472, 2.35619, 0.0)), 1e3, time=500.0),
    ),
    **{
        name: NamedScene(
            f"oblate, c/a = {thickness}: small inertia, hence strong damping at the same St",
            _scene((1.0, 1.0, thickness), SPHEROID_START, 1e3, slow_time=0.05),
        )
        for name, thickness in (("plate", 0.05), ("thin-plate", 0.01))
    },
    **{
        name: NamedScene(
            "a spheroid within 1e-9 of a sphere", _scene((1.0, 1.0, kappa), SPHEROID_START, 1e3, slow_time=0.2)
        )
        for name, kappa in (("near-sphere-prolate", 1 + 1e-9), ("near-sphere-oblate", 1 - 1e-9))
    },
    "near-spheroid": NamedScene(
        "triaxial within 1e-9 of an oblate spheroid: L² = 2EI₂ lies at the edge",
        _scene((1.0, 1 - 1e-9, 0.5), PAPER_START, 1e3, slow_time=0.2),
    ),
    "sphere": NamedScene(
        "a sphere, which has no orientation", _scene((1.0, 1.0, 1.0), PAPER_START, 1e3, slow_time=0.2)
    ),
    "intermediate-axis": NamedScene(
        "the intermediate axis along the vorticity, but for 1e-6: flips, next to L² = 2EI₂ and its singular point",
        _scene(PAPER_ELLIPSOID, BodyStart((0.5, 0.5, 0.5, 0.5), (1e-6, -0.5, 1e-6)), 1e4, time=1e3),
    ),
    "fast-spin": NamedScene(
        "angular velocity of 1e3 shear rates: 16000 rotations in 100 time units",
        _scene(PAPER_ELLIPSOID, BodyStart((0.5, 0.5, 0.5, 0.5), (600.0, 500.0, 624.0)), 1e4, time=100.0),
    ),
    "long": NamedScene("t = 1e6 at St = 1e6: phase errors add up", _scene(PAPER_ELLIPSOID, PAPER_START, 1e6, time=1e6)),
    "stiff": NamedScene("St = 1e-4: truly stiff", _scene(PAPER_ELLIPSOID, PAPER_START, 1e-4, time=50.0)),
    "jeffery": NamedScene("St = 0: a Jeffery orbit of kappa = 2", _scene(PROLATE, SPHEROID_START, 0.0, time=200.0)),
    "jeffery-chaotic": NamedScene(
        "St = 0, slender ellipsoid: chaotic, errors grow exponentially",
        _scene((1.0, 0.1, 0.05), EulerStart((1.4, 0.3, 1.2)), 0.0, time=1e3),
    ),
    "tumbler": NamedScene(
        "kappa = 2 tumbling in the plane of the flow at St = 0.1",
        _scene(PROLATE, BodyStart((0.5, 0.5, 0.5, 0.5), (0.0, -0.5, 0.0)), 0.1, time=100.0),
    ),
}


def named_scene(name: str) -> Scene:
    """Built-in scene of the given name; raises ValueError, with the names there are, if there is none."""
    if name not in SCENES:
        raise ValueError(f"scene: got {name!r}, expected one of {', '.join(SCENES)}")
    return SCENES[name].scene
