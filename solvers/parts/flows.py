"""The flows of a problem's parts, in lanes, with the constants of a step: parts of kernels."""

from collections.abc import Sequence

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

# More slow flows than a step of any scheme has.
_MOST_STAGES = 16


class Flows:
    """The flows of kernels.

    `prepare` computes the constants of a step's flows, `spread` moves rows by a step.

    Chains are compositions of flows beside each other, each in a SIMD lane. Row i of an array of
    constants belongs to stage i, a fast flow and a slow one. The row behind belongs to the last
    fast flow, and with one chain alone a further row to the last and the next one together.
    """

    def __init__(self, parts: Parts, dimension: int, number: type = float, chains: int = 1) -> None:
        self.parts = parts
        self.dimension = dimension
        self.chains = chains
        self.lanes = width() if number is float else 1
        self.fast = parts.fast.flow(OPERATIONS)
        self.slow = parts.slow.flow(OPERATIONS)
        self.rate = parts.rate(OPERATIONS)
        numbers = (0.5,) * 64, 0.5
        self.sizes = len(parts.fast.constants(*numbers)), len(parts.slow.constants(*numbers))
        self.both = (
            parts.both(OPERATIONS)
            if parts.both
            else lambda y, fast, slow, *_: self.slow(self.fast(y, fast), slow)
        )
        self.prepare = self._prepare()
        self.spread = self._spread()

    def constants(self, program: Program, lanes: int = 0) -> Array:
        """Room for the constants of a step, of each chain if lanes are not given."""
        return program.room((_MOST_STAGES + 2) * sum(self.sizes), lanes or self.chains)

    def row(self, constants: Array, i: float | Number) -> Array:
        """Constants from row i on."""
        return constants + i * float(sum(self.sizes))

    def whole(self, y: Array, base: Sequence[Number]) -> tuple[Number, ...]:
        """The state of which an array holds what the first components gain beside a base."""
        state = y.load(self.dimension)
        return *(number + gain for number, gain in zip(base, state, strict=False)), *state[
            len(base) :
        ]

    def fast_flow(self, y: Array, constants: Array, base: Sequence[Number] = ()) -> None:
        """Advance a state."""
        moved = self.fast(self.whole(y, base), constants.load(self.sizes[0]))
        (y + len(base)).store(moved[len(base) :])

    def slow_flow(self, y: Array, constants: Array) -> None:
        """Advance a state."""
        y.store(self.slow(y.load(self.dimension), (constants + self.sizes[0]).load(self.sizes[1])))

    def both_flows(self, y: Array, fast: Array, slow: Array, base: Sequence[Number] = ()) -> None:
        """Advance a state by a fast flow and a slow one, with the constants of two rows."""
        constants = fast.load(self.sizes[0]), (slow + self.sizes[0]).load(self.sizes[1])
        y.store(self.both(self.whole(y, base), *constants, *([y.load(len(base))] if base else [])))

    def _prepare(self) -> Program:
        program = Program("prepare", "scheme p constants", "h", "internal", "noinline")
        scheme, p, constants, h = program.arguments
        shares = (scheme + 1).of(self.chains)
        self.fill(constants.of(self.chains), scheme[0], shares, p, splat(h, self.chains))
        return program

    def fill(
        self, constants: Array, stages: Number, shares: Array | Same, p: Array, h: Number
    ) -> None:
        """Compute the constants of a step h, in as many lanes as they have."""
        fast = self.parts.fast
        slow = self.parts.slow
        lanes = constants.lanes
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
            for row in (i, stages - 1.0 - i) if mirrored else (i,):
                (self.row(constants, row) + self.sizes[0]).store(slow_constants)

    def _spread(self) -> Program:
        """Move rows by a time of each one's own, one in each lane.

        `number` holds the rows, and the steps of each.
        """
        program = Program(
            "spread", "scheme p number times rows", linkage="internal", attribute=WIDEST_REGISTERS
        )
        scheme, p, number, times, rows = program.arguments
        stages = scheme[0]
        last = number[0] - 1.0
        steps = number[1]
        dimension = self.dimension
        lanes = float(self.lanes)
        y = program.room(dimension, self.lanes)
        h = program.room(1, self.lanes)
        constants = self.constants(program, self.lanes)
        entries = y.of(1)
        lengths = h.of(1)
        with program.times(number[0] / lanes) as i:

            def row(k: Number) -> tuple[Number, Array]:
                j = lanes * i + k
                j = OPERATIONS.where_positive(j - last, last, j)
                return j, rows + j * float(dimension)

            with program.times(lanes) as k:
                j, at = row(k)
                lengths[k] = times[j] / steps
                for c in range(dimension):
                    entries[k + c * lanes] = at[c]
            self.fill(constants, stages, Same(scheme + 1, self.lanes), p, h[0])
            with program.times(steps):
                with program.times(stages) as k:
                    self.both_flows(y, self.row(constants, k), self.row(constants, k))
                self.fast_flow(y, self.row(constants, stages))
            with program.times(lanes) as k:
                row(k)[1].store([entries[k + c * lanes] for c in range(dimension)])
        return program
