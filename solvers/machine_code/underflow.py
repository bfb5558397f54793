"""Numbers below 2e-308 as zero while a library runs.

Components that have died out leave such numbers, on which a processor spends far more time than on
others: with them a step of CyRK took 25 µs instead of 0.5 µs (the paper's ellipsoid by quaternions,
after it had settled). A run that goes on long after that would stall.
"""

import ctypes
import platform
from collections.abc import Callable
from pathlib import Path

from polhode.models.once import once
from polhode.solvers.machine_code.llvm import compile_file

# Control word (MXCSR) of x86's floating-point unit: 0x1F80, its usual one, stops at no exception;
# 0x8000 flushes results to zero, 0x0040 operands.
_FLUSHING = 0x1F80 | 0x8000 | 0x0040


class FlushedToZero:
    """Within it numbers below 2e-308 are zero in this thread, on x86 alone.

    The first one of a process compiles a few lines of machine code. CyRK and SUNDIALS make one while
    they prepare, so that no run is charged with this. `splitting` and `lanes` make one inside the
    run, so that the first such run of a process is charged with it.

    An instance serves one block at a time, since it remembers one control word. It may be entered
    again once it was left. Blocks inside each other, and threads, take an instance each: otherwise
    the inner block's flushing word, or another thread's word, would be restored at the end.
    """

    def __init__(self) -> None:
        self._exchange = _exchange()

    def __enter__(self) -> None:
        self._before = self._exchange(_FLUSHING)

    def __exit__(self, *_: object) -> None:
        self._exchange(self._before)


@once()
def _exchange() -> Callable[[int], int]:
    """Set the control word and return the one before."""
    if platform.machine() not in ("x86_64", "AMD64"):
        return lambda word: word
    code = compile_file(Path(__file__).with_suffix(".ll"))
    return code.function(ctypes.PYFUNCTYPE(ctypes.c_uint32, ctypes.c_uint32))
