"""Two thousand particles, each of another shape: how they end, and where their shortest axes point.

A shape is only numbers to the compiled equations: nothing is compiled anew. One core takes some
milliseconds a particle.
"""

import numpy as np

import polhode
from polhode import BodyStart, Ellipsoid, Scene

STOKES = 100.0
SLOW_TIME = 1.0


def scenes(count: int, seed: int = 1):
    """Scenes of random shapes, orientations and spins of about the shear rate."""
    random = np.random.default_rng(seed)
    for _ in range(count):
        middle, short = np.sort(random.uniform(0.3, 1.0, 2))[::-1]
        quaternion = random.standard_normal(4)
        start = BodyStart(quaternion / np.linalg.norm(quaternion), random.standard_normal(3))
        yield Scene(Ellipsoid((1.0, middle, short)), STOKES, start, SLOW_TIME * STOKES)


def shortest_axis(scene: Scene) -> np.ndarray:
    """The shortest body axis in space at the end of a run: a row of the rotation matrix."""
    solution = polhode.solve(scene, error=1e-4, want="orientation", samples=2)
    assert solution.success, solution
    return solution.rotation[-1, np.argmin(scene.ellipsoid.semi_axes)]


def main(count: int = 2000) -> np.ndarray:
    """Print the mean squares of the shortest axes' components, and return the axes, shape (n, 3)."""
    axes = np.array([shortest_axis(scene) for scene in scenes(count)])
    for name, share in zip("xyz", np.mean(axes**2, axis=0), strict=True):
        print(f"<p_{name}²> = {share:.2f}")
    return axes


if __name__ == "__main__":
    AXES = main()
