"""Checks and notes of a problem that a user states: its Jacobian, and a start that was moved.

A timed problem has the time as its last component, since fields do not take it; users' functions do.
"""

from typing import Any

import numpy as np

from polhode.harness.common.text import short
from polhode.models.own_function import OwnField, in_one_line
from polhode.models.problem import Problem
from polhode.solvers.structure import structure_of


def check_jacobian(problem: Problem) -> None:
    """Raise ValueError unless the user's Jacobian, where it is a function, is a matrix at the start.

    Its shape is (d, d) for the user's d components.
    """
    field = problem.field
    structure = structure_of(problem)
    if structure is None or not callable(structure.jacobian):
        return
    assert isinstance(field, OwnField)
    # The last component of a timed problem is the time, for the user's functions an argument of its own.
    start = np.array(problem.start[: problem.dimension - problem.timed])
    shape = (len(start), len(start))
    time = float(field.time_at(0.0))
    expected = f"expected a function (t, y) that returns a matrix of shape {shape}"
    try:
        with np.errstate(all="ignore"):
            matrix: Any = structure.jacobian(time, start, *problem.field_parameters)
    except Exception as error:
        # Cut to 150 characters, an estimate: a message that prints whole arrays does not bury what
        # was expected.
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise ValueError(f"jacobian: got {reason:.150} at the start, {expected}") from error
    # SciPy's sparse matrices have this method, and a shape already.
    if not hasattr(matrix, "tocsc"):
        try:
            matrix = np.array(matrix, dtype=float)
        except (TypeError, ValueError):
            raise ValueError(f"jacobian: got {in_one_line(matrix)}, {expected}") from None
    if matrix.shape != shape:
        raise ValueError(f"jacobian: got shape {matrix.shape}, {expected}")


def moved_start(problem: Problem, states: np.ndarray, rtol: Any, atol: Any) -> str:
    """A sentence on how algebraic equations have moved the start beyond the tolerance; empty if they have not.

    `states`, one row per time, begin at the start of the run; the time, where it is a component,
    stands last in them. `rtol` and `atol` come from the user: one number, or one for each of the
    user's d components, shape (d,), none for the time.
    """
    # Problems with parameters of the explicit form have no algebraic equations.
    if problem.parameters is not None or not len(states):
        return ""
    given = np.array(problem.start[: problem.dimension - problem.timed])
    start = states[0, : len(given)]
    allowed = np.asarray(rtol) * np.abs(given) + np.asarray(atol)
    moved = np.flatnonzero(np.abs(start - given) > allowed)
    if not len(moved):
        return ""
    largest = moved[np.argmax(np.abs(start - given)[moved])]
    others = f" and {len(moved) - 1} more" if len(moved) > 1 else ""
    change = f"y[{largest}] from {short(float(given[largest]))} to {short(float(start[largest]))}{others}"
    return f"the start was moved to meet the algebraic equations: {change}"
