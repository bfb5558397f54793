"""The flows of a problem's parts, in lanes, with the constants of a step: parts of kernels.

A scheme reaches machine code as one array, as `schemes.Scheme.numbers` lays it out. A scheme has s
stages and c chains. Its one chain that leads to rows has s' stages. `stages_of`, `shares_of`,
`weights_of` and `row_scheme_of` find their numbers in the array::

    s | fast shares, (s + 1, c) | slow shares, (s, c) | weights, (c,) | s' | fast, s' + 1 | slow, s'
"""

from collections.abc import Callable, Sequence
from typing import Any

from polhode.models.problem import Parts
from polhode.solvers.machine_code.program import (
    WIDE,
    WIDEST_REGISTERS,
    Array,
    Program,
    Same,
    splat,
    width,
)
from polhode.solvers.machine_code.tracing import OPERATIONS, Number

# Slow flows in a step for which room is made: no scheme has more than eight.
_MAX_STAGES = 16
# Parameters that stand in where a part's constants are only counted: no problem with parts has more
# than fourteen.
_MAX_PARAMETERS = 64


class SpreadAt:
    """Places in the numbers of `Flows.spread`."""

    ROWS = 0
    STEPS = 1  # by which each row is moved
    SIZE = 2


def stages_of(scheme: Array) -> Number:
    """Number s of slow flows in a step."""
    return scheme[0]


def shares_of(scheme: Array, lanes: int) -> Array:
    """Shares of a step, `lanes` at an index: s + 1 fast ones, then s slow ones."""
    return (scheme + 1).of(lanes)


def fast_share_of(scheme: Array, i: Number) -> Number:
    """Share of fast flow i, of a scheme of one chain."""
    return scheme[i + 1.0]


def weights_of(scheme: Array, stages: Number, chains: int) -> Number:
    """Weights of the chains, one in each lane; they stand behind all shares."""
    return shares_of(scheme, chains)[2.0 * stages + 1.0]


def row_scheme_of(scheme: Array, stages: Number, chains: int) -> Array:
    """The scheme that leads to rows, behind the weights."""
    return scheme + (1.0 + (2.0 * stages + 2.0) * chains)


def constant_counts(parts: Parts) -> tuple[int, int]:
    """Numbers of constants of a fast flow and of a slow one."""
    # Any parameters and any time will do.
    any_numbers = (0.5,) * _MAX_PARAMETERS, 0.5
    return len(parts.fast.constants(*any_numbers)), len(parts.slow.constants(*any_numbers))


class Flows:
    """The flows of kernels.

    `prepare` computes the constants of a step's flows, `spread` moves rows by a step. `number` is
    the type of numbers, float or `numpy.longdouble`; SIMD lanes hold no long doubles, so that rows
    of these are moved one by one.

    Chains are compositions of flows beside each other, each in a SIMD lane. Row i of an array of
    constants belongs to stage i: it holds the constants of a fast flow, then of the slow flow behind
    it. An array for s stages has s + 2 rows. Row s has the last fast flow of a step. Row s + 1, of one
    chain alone, has the last fast flow and the first one of the next step, as one flow of both times.
    """

    def __init__(self, parts: Parts, dimension: int, number: type = float, chains: int = 1) -> None:
        self.parts = parts
        self.dimension = dimension
        self.chains = chains
        self.lanes = width() if number is float else 1
        self.fast = parts.fast.flow(OPERATIONS)
        self.slow = parts.slow.flow(OPERATIONS)
        self.rate = parts.rate(OPERATIONS)
        # Numbers of constants in a row.
        self.fast_size, self.slow_size = constant_counts(parts)
        self.row_size = self.fast_size + self.slow_size
        # It takes what has been gained, too, if the parts restore it.
        self.both: Callable[..., Sequence[Any]] = self._one_after_the_other
        if parts.both:
            self.both = parts.both(OPERATIONS)
        self.prepare = self._prepare()
        self.spread = self._spread()

    def _one_after_the_other(self, y: Any, fast: Any, slow: Any) -> Sequence[Any]:
        """The fast flow, then the slow one, of parts that know no quicker way."""
        return self.slow(self.fast(y, fast), slow)

    def constants(self, program: Program, lanes: int = 0) -> Array:
        """Room for the constants of a step, of each chain if lanes are not given."""
        return program.room((_MAX_STAGES + 2) * self.row_size, lanes or self.chains)

    def row(self, constants: Array, i: float | Number) -> Array:
        """Row i of constants, and all rows behind it."""
        return constants + i * float(self.row_size)

    def slow_constants(self, row: Array) -> Array:
        """A row's constants of the slow flow, which stand behind the constants of the fast one."""
        return row + self.fast_size

    def whole(self, y: Array, base: Sequence[Number]) -> tuple[Number, ...]:
        """The state that an array holds, whose first components may be gains on the base."""
        numbers = y.load(self.dimension)
        firsts = [before + gain for before, gain in zip(base, numbers, strict=False)]
        return *firsts, *numbers[len(base) :]

    def fast_flow(self, y: Array, row: Array, base: Sequence[Number] = ()) -> None:
        """Advance a state by the fast flow of a row of constants; `base` as in `whole`.

        The flow leaves the components of a base alone, and so their gains.
        """
        moved = self.fast(self.whole(y, base), row.load(self.fast_size))
        (y + len(base)).store(moved[len(base) :])

    def slow_flow(self, y: Array, row: Array) -> None:
        """Advance a state by the slow flow of a row of constants."""
        y.store(self.slow(y.load(self.dimension), self.slow_constants(row).load(self.slow_size)))

    def both_flows(
        self, y: Array, fast_row: Array, slow_row: Array, base: Sequence[Number] = ()
    ) -> None:
        """Advance a state by a fast flow and a slow one, whose constants are of two rows."""
        fast = fast_row.load(self.fast_size)
        slow = self.slow_constants(slow_row).load(self.slow_size)
        state = self.whole(y, base)
        if base:
            # The gains advance in the place of the components themselves.
            y.store(self.both(state, fast, slow, y.load(len(base))))
        else:
            y.store(self.both(state, fast, slow))

    def _prepare(self) -> Program:
        """Compute the constants of a step of time `h`, of each chain."""
        program = Program("prepare", "scheme p constants", "h", "internal", "noinline")
        scheme, p, constants, h = program.arguments
        shares = shares_of(scheme, self.chains)
        stages = stages_of(scheme)
        self.fill(constants.of(self.chains), stages, shares, p, splat(h, self.chains))
        return program

    def fill(
        self, constants: Array, stages: Number, shares: Array | Same, p: Array, h: Number
    ) -> None:
        """Compute the constants of a step of time h, in as many lanes as they have.

        `Same` shares belong to the scheme that leads to rows, of one chain in every lane.
        """
        fast = self.parts.fast
        slow = self.parts.slow
        lanes = constants.lanes
        # A scheme of one chain reads alike from either end: half of its slow flows are computed.
        mirrored = self.chains == 1 or isinstance(shares, Same)
        ops = WIDE if lanes > 1 else OPERATIONS
        parameters = Same(p, lanes)
        program = constants.program
        with program.times(stages + 1.0) as i:
            self.row(constants, i).store(fast.constants(parameters, shares[i] * h, ops))
        if self.chains == 1:
            self.row(constants, stages + 1.0).store(
                fast.constants(parameters, 2.0 * shares[0] * h, ops)
            )
        with program.times(0.5 * stages if mirrored else stages) as i:
            slow_constants = slow.constants(parameters, shares[stages + 1.0 + i] * h, ops)
            self.slow_constants(self.row(constants, i)).store(slow_constants)
            if mirrored:
                mirror_image = self.row(constants, stages - 1.0 - i)
                self.slow_constants(mirror_image).store(slow_constants)

    def _spread(self) -> Program:
        """Move rows by a time of each one's own, one row in each lane.

        `SpreadAt` names the `numbers`. The last row fills the lanes that are left over: it is moved
        alike in all of them, and written once more by each.
        """
        program = Program(
            "spread", "scheme p numbers times rows", linkage="internal", attribute=WIDEST_REGISTERS
        )
        scheme, p, numbers, times, rows = program.arguments
        stages = stages_of(scheme)
        last = numbers[SpreadAt.ROWS] - 1.0
        steps = numbers[SpreadAt.STEPS]
        dimension = self.dimension
        lanes = float(self.lanes)
        y = program.room(dimension, self.lanes)
        h = program.room(1, self.lanes)
        constants = self.constants(program, self.lanes)
        # The same places number by number: entry k + c * lanes is component c of the row in lane k.
        entries = y.of(1)
        lengths = h.of(1)
        with program.times(numbers[SpreadAt.ROWS] / lanes) as i:

            def row_of(k: Number) -> Number:
                """Number of the row in lane k."""
                j = lanes * i + k
                return OPERATIONS.where_positive(j - last, last, j)

            with program.times(lanes) as k:
                j = row_of(k)
                at = rows + j * float(dimension)
                lengths[k] = times[j] / steps
                for c in range(dimension):
                    entries[k + c * lanes] = at[c]
            shares = Same(shares_of(scheme, 1), self.lanes)
            self.fill(constants, stages, shares, p, h[0])
            with program.times(steps):
                with program.times(stages) as k:
                    self.both_flows(y, self.row(constants, k), self.row(constants, k))
                self.fast_flow(y, self.row(constants, stages))
            with program.times(lanes) as k:
                at = rows + row_of(k) * float(dimension)
                at.store([entries[k + c * lanes] for c in range(dimension)])
        return program
