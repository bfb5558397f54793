"""What every form of the equations of motion offers, whoever wrote it."""

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, ClassVar, Literal

from polhode.models.problem import Problem

if TYPE_CHECKING:
    import numpy as np

    from polhode.models.observables import Observables
    from polhode.models.scene import BodyStart, EulerStart, Scene

Orientation = Literal["full", "axis", "none"]


class FormNotValidError(ValueError):
    """A scene lies outside a form's validity; the message names the condition and the form to use instead.

    Parameters
    ----------
    message : str
    condition : str, optional
        What failed, without the form's name and the advice; the whole message by default.
    """

    def __init__(self, message: str, condition: str | None = None) -> None:
        super().__init__(message, condition)
        self.condition = message if condition is None else condition

    def __str__(self) -> str:
        """The message."""
        return self.args[0]


class Form(ABC):
    """One way to write the equations of motion for a scene.

    1. `check` refuses a scene outside the form's validity; it says why, and which form to use instead.
    2. `problem` turns a scene into an initial value problem: field, parameters, start, end.
    3. `observe` maps the states of a solution to observables, the same for every form.
    4. A form keeps no data of its own: everything comes from the scene, so that forms pickle and compare by name.
    5. The vector field is a factory at the top of the form's module, over generic numbers, in mass form: the rows of
       the angular velocity carry the mass ``p[0]`` (alpha) and the torque the factor ``p[1]`` (beta), so that
       (alpha, beta) = (1, 1/St) is the explicit form and (St, 1) the implicit one.
    """

    name: ClassVar[str]
    summary: ClassVar[str]
    valid_for: ClassVar[str]
    state: ClassVar[tuple[str, ...]]
    orientation: ClassVar[Orientation]
    averaged: ClassVar[bool] = False

    @abstractmethod
    def check(self, scene: "Scene") -> None:
        """Refuse a scene that this form does not describe.

        Raises
        ------
        FormNotValidError
            Naming the condition that fails and the form to use instead.
        """

    @abstractmethod
    def problem(self, scene: "Scene") -> Problem:
        """Initial value problem of a scene that `check` accepts.

        Raises
        ------
        FormNotValidError
            As `check` does.
        """

    @abstractmethod
    def observe(self, scene: "Scene", states: "np.ndarray") -> "Observables":
        """Observables of the states, shape (n, d), of a solution of `problem`."""

    def reach(self, scene: "Scene") -> float:
        """Slow time to which the form follows a scene: its end, unless the form is one that stops short.

        Raises
        ------
        FormNotValidError
            If the scene cannot be followed at all.
        """
        self.check(scene)
        return scene.slow_time

    def demands(self, scene: "Scene") -> str:
        """What makes a scene so costly to prepare that nobody would run this form unasked; empty where nothing does."""
        return ""

    def require_orientation(self, scene: "Scene") -> "EulerStart | BodyStart":
        """The scene's start, if it has an orientation.

        Raises
        ------
        FormNotValidError
            If it gives L and E alone.
        """
        from polhode.models.scene import SlowStart

        if isinstance(scene.start, SlowStart):
            instead = "averaged" if scene.ellipsoid.kind == "triaxial" else "averaged-spheroid"
            raise self.refuse("the start gives L and E but no orientation", instead)
        return scene.start

    def refuse(self, condition: str, instead: str) -> FormNotValidError:
        """Make the error that says which condition failed and which form to use instead."""
        return FormNotValidError(f"form {self.name!r}: {condition}; use {instead!r}", condition)
