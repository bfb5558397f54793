"""A call that nothing but the end of its process stops; in a module, so that a spawned process finds it."""

import ctypes


def sleep_holding_the_lock(seconds: int) -> None:
    """Sleep in C with the interpreter's lock held."""
    ctypes.PyDLL(None).sleep(seconds)
