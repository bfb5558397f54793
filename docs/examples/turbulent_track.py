"""A fibre along a synthetic turbulent track: from SI units to St, a track of gradients, and how the fibre tumbles."""

from dataclasses import dataclass
from math import sqrt
from pathlib import Path

import numpy as np

from polhode import Ellipsoid, EulerStart, Flow, Scene, solve
from polhode.models.files.track_file import track_text

# Correlation times along a fluid particle's path, in Kolmogorov times.
STRAIN_TIME = 2.3
ROTATION_TIME = 7.2
# Fourier modes of each entry of the gradient.
MODES = 64
# Knots in a Kolmogorov time.
KNOTS_PER_TIME = 8


@dataclass(frozen=True)
class Suspension:
    """A particle in a turbulent fluid, in SI units; semi-axes in m, the third along the symmetry axis."""

    semi_axes: tuple[float, float, float]
    particle_density: float  # kg/m³
    fluid_density: float  # kg/m³
    viscosity: float  # Pa s
    dissipation: float  # of kinetic energy, m²/s³

    @property
    def rate(self) -> float:
        """The reference rate γ̇ = √(ε/ν) in 1/s: the inverse Kolmogorov time."""
        return sqrt(self.dissipation * self.fluid_density / self.viscosity)

    @property
    def stokes(self) -> float:
        """St = ρ_particle γ̇ l²/μ, with the longest semi-axis l."""
        return self.particle_density * self.rate * max(self.semi_axes) ** 2 / self.viscosity

    @property
    def reynolds(self) -> float:
        """Re = ρ_fluid γ̇ l²/μ, which is to be small."""
        return self.stokes * self.fluid_density / self.particle_density


def turbulent_gradients(times: np.ndarray, seed: int) -> np.ndarray:
    """Random Fourier gradients over γ̇, shape (n, 3, 3), with ⟨S:S⟩ = ⟨O:O⟩ = ½ as in isotropic turbulence."""
    random = np.random.default_rng(seed)
    entries = random.normal(size=(2, MODES, 3, 3))
    strain = (entries[0] + entries[0].swapaxes(1, 2)) / 2
    strain -= np.trace(strain, axis1=1, axis2=2)[:, None, None] * np.eye(3) / 3
    rotation = (entries[1] - entries[1].swapaxes(1, 2)) / 2
    gradients = np.zeros((len(times), 3, 3))
    for part, correlation, size in ((strain, STRAIN_TIME, 5.0), (rotation, ROTATION_TIME, 3.0)):
        # The mean square of a part's norm is `size`; a cosine has the mean square ½.
        frequency = random.normal(size=MODES) / correlation
        phase = random.uniform(0.0, 2 * np.pi, MODES)
        waves = np.cos(np.outer(times, frequency) + phase)
        gradients += np.tensordot(waves, part, axes=1) / sqrt(MODES * size)
    return gradients


def along_track(suspension: Suspension, duration: float, seed: int) -> Scene:
    """The scene of so many Kolmogorov times, which starts as it would without inertia."""
    times = np.linspace(0.0, duration, int(KNOTS_PER_TIME * duration) + 1)
    flow = Flow.track(times, turbulent_gradients(times, seed))
    shape = Ellipsoid(suspension.semi_axes)
    start = EulerStart((1.0, 0.5, 0.2))
    return Scene(shape, suspension.stokes, start, duration, flow)


def tumbling_rate(scene: Scene) -> float:
    """Mean square of |dp/dt| over γ̇², from the angular velocity across the axis p; the start is left out."""
    motion = solve(scene, error=1e-6, want="orientation", samples=2001)
    axis = motion.rotation[:, 2]
    across = np.cross(motion.angular_velocity, axis)
    return float(np.mean(np.sum(across**2, axis=1)[200:]))


FIBRE = Suspension((5e-6, 5e-6, 5e-5), 1300.0, 1000.0, 1e-3, 1e-2)  # cellulose in stirred water
GRAIN = Suspension((5e-5, 5e-5, 1e-4), 2600.0, 1.2, 1.8e-5, 1.0)  # a grain of sand in a fan's air
RESULTS: dict[str, float] = {}

if __name__ == "__main__":
    for name, suspension in (("fibre", FIBRE), ("grain", GRAIN)):
        print(f"{name}: γ̇ = {suspension.rate:.3g} 1/s, St = {suspension.stokes:.3g}", end=", ")
        print(f"Re = {suspension.reynolds:.2g}")
        RESULTS[name] = float(
            np.mean([tumbling_rate(along_track(suspension, 200.0, seed)) for seed in range(10)])
        )
        print(f"  it tumbles with ⟨|dp/dt|²⟩ = {RESULTS[name]:.3f} γ̇², over 10 tracks")
    # The same from files, as the command line takes them: polhode solve fibre.toml
    scene = along_track(FIBRE, 20.0, 1)
    assert scene.flow is not None
    Path("track.csv").write_text(track_text(scene.flow), encoding="utf-8")
    Path("fibre.toml").write_text(
        f"stokes = {scene.stokes!r}\n"
        f"time = {scene.time!r}\n"
        "[shape]\n"
        f"semi_axes = {list(FIBRE.semi_axes)}\n"
        "[start]\n"
        "euler_angles = [1.0, 0.5, 0.2]\n"
        "at_rest = true\n"
        "[flow]\n"
        'track = "track.csv"\n',
        encoding="utf-8",
    )
    run = solve("fibre.toml")
    print(f"fibre.toml: {run.status}, {run.work.steps} steps, {run.error.words()}")
