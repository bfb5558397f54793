"""Make `whole_runs.json`: whole runs of many kinds of scenes by a program that shares nothing with polhode.

    python tests/oracle/whole_runs/make_whole_runs.py

It needs a C compiler with a long double of 80 bits, and mpmath, and takes some minutes. Moments of
inertia and resistances are integrals, evaluated by mpmath's quadrature. Each scene is run twice, with
other tolerances and orders; the difference of the two is the uncertainty that is kept.
"""

import json
import subprocess
import tempfile
from pathlib import Path

import mpmath as mp
import numpy as np

HERE = Path(__file__).parent
# Digits of the constants: a few more than long double holds.
mp.mp.dps = 25
# Equispaced times of a run, its start and end among them.
ROWS = 11
# Tolerance of a step and columns of the extrapolation (`whole_runs.c`), of the run that is kept and of its
# check: estimates.
KEPT = ("1e-17", 6)
CHECK = ("1e-16", 5)

# Semi-axes, in units of the longest.
BODIES = {
    "prolate": (0.5, 0.5, 1.0),
    "oblate": (1.0, 1.0, 0.4),
    "needle": (0.05, 0.05, 1.0),
    "disc": (1.0, 1.0, 0.05),
    "triaxial": (1.0, 0.8, 0.5),
    "near-spheroid": (1.0, 0.999, 0.5),
}
# Angular velocity about the body axes, in shear rates. These numbers, St and durations are made up.
STARTS = {"rest": (0.0, 0.0, 0.0), "tumbling": (0.4, -0.5, 0.3), "fast": (4.0, 2.0, -3.0)}
# St and duration, in inverse shear rates; each of the starts of a body takes one, in turn.
SCALES = ((1e-3, 3.0), (1e-1, 20.0), (1e1, 40.0), (1e3, 400.0), (1e5, 2e4), (1e7, 1e5))


def moments(axes):
    """Moments of inertia of the solid of unit density, by quadrature along each axis."""
    # The cross-section at height z of the ellipsoid (p, q, r) has the area π p q (1 - z²/r²).

    def second_moment(p, q, r):
        return mp.quad(lambda z: mp.pi * p * q * (1 - (z / r) ** 2) * z**2, [-r, r])

    a, b, c = map(mp.mpf, axes)
    second = [second_moment(b, c, a), second_moment(c, a, b), second_moment(a, b, c)]
    total = sum(second)
    return [total - value for value in second]


def resistances(axes):
    """X_i of Jeffery's torque, from his integrals over the confocal ellipsoids."""
    a, b, c = map(mp.mpf, axes)

    def integral(square):
        def value(t):
            return 1 / ((square + t) * mp.sqrt((a**2 + t) * (b**2 + t) * (c**2 + t)))

        # Places at which the quadrature is divided, by estimate: before, at and beyond the squares of the axes.
        return a * b * c * mp.quad(value, [0, c**2 / 100, 1, 10, mp.inf])

    squares = [a**2, b**2, c**2]
    beta = [integral(square) for square in squares]
    found = []
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        weight = squares[j] * beta[j] + squares[k] * beta[k]
        found.append(mp.mpf(2) / 3 * a * b * c * (squares[j] + squares[k]) / weight)
    return found


def rows_of(quaternion):
    """Body axes in space components, by Rodrigues' formula in mpmath."""
    q0, q1, q2, q3 = map(mp.mpf, quaternion)
    norm = q0**2 + q1**2 + q2**2 + q3**2
    cross = mp.matrix([[0, -q3, q2], [q3, 0, -q1], [-q2, q1, 0]])
    to_space = mp.eye(3) + 2 * (q0 * cross + cross * cross) / norm
    return to_space.T


def run(program, scene, tolerance, columns):
    """Times and states of a scene, as text: a row has the time, the 9 entries of the matrix of `rows_of`, and L."""
    inertia = moments(scene["semi_axes"])
    axes = rows_of(scene["quaternion"])
    spin = [mp.mpf(value) for value in scene["angular_velocity"]]
    momentum = [sum(axes[i, c] * inertia[i] * spin[i] for i in range(3)) for c in range(3)]
    numbers = [scene["stokes"], *scene["semi_axes"], *inertia, *resistances(scene["semi_axes"])]
    numbers += [axes[i, c] for i in range(3) for c in range(3)]
    numbers += momentum
    # More digits than long double has.
    text = " ".join(mp.nstr(mp.mpf(number), 22) for number in numbers)
    text += f" {tolerance} {columns} {ROWS} {scene['time']!r}"
    answer = subprocess.run(
        [program], input=text, capture_output=True, text=True, check=True, timeout=300
    )
    return [line.split() for line in answer.stdout.splitlines()]


def scenes():
    """A scene for each body and start, from a random orientation."""
    generator = np.random.default_rng(20261126)
    number = 0
    for body, axes in BODIES.items():
        for start, spin in STARTS.items():
            stokes, time = SCALES[(number + number // 3) % len(SCALES)]
            quaternion = generator.normal(size=4)
            quaternion /= np.linalg.norm(quaternion)
            yield {
                "name": f"{body}-{start}",
                "semi_axes": axes,
                "stokes": stokes,
                "time": time,
                "quaternion": quaternion.tolist(),
                "angular_velocity": spin,
            }
            number += 1


def main():
    """Run all scenes and write the file."""
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder, "whole_runs")
        source = HERE / "whole_runs.c"
        subprocess.run(["cc", "-O3", "-o", program, source, "-lm"], check=True, timeout=300)
        made = []
        for scene in scenes():
            kept = run(program, scene, *KEPT)
            check = run(program, scene, *CHECK)
            # Largest difference of a number, over its largest size.
            first = np.array(kept, dtype=np.longdouble)[:, 1:]
            second = np.array(check, dtype=np.longdouble)[:, 1:]
            size = np.array([1.0] * 9 + [np.abs(first[:, 9:]).max()] * 3)
            uncertainty = float(np.max(np.abs(first - second) / size))
            print(scene["name"], scene["stokes"], f"{uncertainty:.1e}", flush=True)
            made.append({**scene, "uncertainty": uncertainty, "rows": kept})
    text = json.dumps(made, indent=0)
    (HERE / "whole_runs.json").write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
