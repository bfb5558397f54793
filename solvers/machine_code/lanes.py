"""Maps of states, repeated in machine code with one particle in each SIMD lane.

A map is a straight line of arithmetic, traced like a vector field. `program.widened` makes each of its
lines one about vectors. Maps use arithmetic and the operations that LLVM has for vectors.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from polhode.solvers.machine_code.program import WIDEST_REGISTERS, Program, compiled, splat, width
from polhode.solvers.machine_code.underflow import FlushedToZero

Step = Callable[[Sequence[Any], Sequence[Any]], Sequence[Any]]


@dataclass(frozen=True)
class Lanes:
    """A compiled map; see `lanes`."""

    # Takes states, constants and counts, three arrays as in `march`, and fills the states.
    code: Callable[..., None]
    dimension: int  # of the state, d

    def march(self, starts: np.ndarray, rows: int, constants: np.ndarray, steps: int) -> np.ndarray:
        """States in lanes, shape (groups, rows, d, width).

        A group is `width()` particles, moved at once. From each row to the next come the map `before`,
        `steps` times the map that is stepped, and the map `after`. `constants` are doubles one behind
        another, as many as `lanes` was told: nothing checks that.

        The last of the starts, shape (n, d), fills the lanes that are left over.
        """
        groups = -(-len(starts) // width())
        states = np.empty((groups, rows, self.dimension, width()))
        filled = starts[np.minimum(np.arange(groups * width()), len(starts) - 1)]
        states[:, 0] = filled.reshape(groups, width(), self.dimension).swapaxes(1, 2)
        with FlushedToZero():
            self.code(states, constants, np.array([steps, rows, groups], dtype=float))
        return states


def by_particle(states: np.ndarray, particles: int) -> np.ndarray:
    """States in lanes as states of particles, shape (particles, rows, d), one component after another in memory."""
    groups, rows, dimension, wide = states.shape
    return np.moveaxis(states.transpose(2, 0, 3, 1).reshape(dimension, groups * wide, rows), 0, 2)[
        :particles
    ]


def lanes(
    step: Step,
    dimension: int,
    constants: int,
    before: Step | None = None,
    after: Step | None = None,
) -> Lanes:
    """Compile ``step(y, constants) -> y`` over generic numbers.

    `constants` is their number; they are the same for all particles.

    The map `before` turns a row into the state that is stepped, and `after` turns that state into
    the next row.
    """
    wide = width()
    program = Program("march", "states constants counts", attribute=WIDEST_REGISTERS)
    states, numbers, counts = program.arguments
    steps, rows, groups = counts.load(3)
    # Each constant in all lanes. A number that is computed before a loop exists in the loop, too.
    c = [splat(constant, wide) for constant in numbers.load(constants)]
    y = program.room(dimension, wide)
    with program.times(groups) as group:
        first = states.of(wide) + group * rows * float(dimension)
        with program.times(rows - 1.0) as row:
            at = first + row * float(dimension)
            y.store(before(at.load(dimension), c) if before else at.load(dimension))
            with program.times(steps):
                y.store(step(y.load(dimension), c))
            (at + dimension).store(after(y.load(dimension), c) if after else y.load(dimension))
    # LLVM's highest level: an estimate. That long loops gain nothing by it (`compiled`) was not measured for maps.
    return Lanes(compiled(program, level=3)[0], dimension)
