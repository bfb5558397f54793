"""The contract of a form of the equations of motion, and its errors."""

from abc import ABC, abstractmethod
from math import inf
from typing import ClassVar, Literal

import numpy as np

from polhode.models.catalogue import averaged_form, full_form
from polhode.models.observables import Observables
from polhode.models.problem import Factory, Floats, Invariant, Problem
from polhode.models.scene import BodyStart, EulerStart, Scene, SlowStart

# `Form.observe` gives one of these: the whole rotation matrix, its row of the symmetry axis alone, or neither.
Orientation = Literal["full", "axis", "none"]

# Advice that ends the refusal of a start by L and E alone where no averaged form takes it.
_WAY_OUT = "give a start with angles or a quaternion"


class FormNotValidError(ValueError):
    """A scene lies outside a form's validity: the `condition` that failed, the `form`, the one to use `instead`."""

    def __init__(self, condition: str, form: str = "", instead: str = "") -> None:
        super().__init__(condition, form, instead)
        self.condition = condition
        self.form = form
        self.instead = instead

    @property
    def reason(self) -> str:
        """Condition and advice, for a reader who knows which form it is."""
        return self.condition + (f"; use {self.instead!r}" if self.instead else "")

    def __str__(self) -> str:
        """The message: form, condition and advice."""
        return (f"form {self.form!r}: " if self.form else "") + self.reason


class Form(ABC):
    """One way to write the equations of motion for a scene.

    1. `check` refuses a scene outside the form's validity; it says why, and which form to use
       instead. A form that knows simple shear alone calls `require_flow` there.
    2. `problem` turns a scene into an initial value problem: field, parameters, start, end.
    3. `observe` maps the states of a solution to observables, the same for every form.
    4. A form has no data of its own: everything comes from the scene, so that forms pickle and
       compare by name.
    5. The vector field is a factory at the top of the form's module, over generic numbers. Where the
       full equations have both inertia and torque, it is in mass form: the rows of the angular
       velocity, or of L, carry the mass ``p[0]`` (alpha), the torque carries the factor ``p[1]``
       (beta). (alpha, beta) = (1, 1/St) is the explicit form, (St, 1) the implicit one.
    """

    # Attributes that every form sets; the catalogue refuses one without them.
    required: ClassVar[tuple[str, ...]] = ("name", "state", "orientation")
    name: ClassVar[str]
    summary: ClassVar[str] = ""
    valid_for: ClassVar[str] = ""
    # Names of the components of its states.
    state: ClassVar[tuple[str, ...]]
    orientation: ClassVar[Orientation]
    averaged: ClassVar[bool] = False
    # Whether its equations hold in every linear flow; all others are derived for shear.
    any_flow: ClassVar[bool] = False
    # Whether its orientation is by angles. Such a form costs more than the quaternion form. Its errors are
    # the same, or larger near a pole of its angles.
    angles: ClassVar[bool] = False

    @abstractmethod
    def check(self, scene: Scene) -> None:
        """Raise FormNotValidError for a scene that this form does not describe."""

    def takes(self, scene: Scene) -> bool:
        """Whether this form accepts a scene."""
        try:
            self.require_flow(scene)
            self.check(scene)
        except FormNotValidError:
            return False
        return True

    @abstractmethod
    def problem(self, scene: Scene) -> Problem:
        """Initial value problem of a scene that `check` accepts; raises as `check` does."""

    @abstractmethod
    def observe(self, scene: Scene, states: np.ndarray) -> Observables:
        """Observables of the states, shape (n, d), of a solution of `problem`."""

    def reach(self, scene: Scene) -> float:
        """Slow time to which the form follows a scene: its end, unless the form stops short; raises as `check` does."""
        self.check(scene)
        return scene.slow_time

    def orientation_of(self, scene: Scene) -> Orientation:
        """The orientation that `observe` gives: the rotation matrix, its row of the symmetry axis, or none."""
        return self.orientation

    def state_of(self, scene: Scene) -> tuple[str, ...]:
        """Names of the components of a scene's states; along a track the time is the last one."""
        along_track = scene.flow is not None and scene.flow.varies
        return (*self.state, "t") if along_track else self.state

    def known_axes(self, scene: Scene) -> tuple[int, ...]:
        """Body axes (0, 1, 2) whose directions, the rows of the rotation matrix, `observe` gives."""
        symmetry = scene.ellipsoid.symmetry_axis
        axis = 2 if symmetry is None else symmetry
        return {"full": (0, 1, 2), "axis": (axis,), "none": ()}[self.orientation_of(scene)]

    def require_orientation(self, scene: Scene) -> EulerStart | BodyStart:
        """The scene's start; raises FormNotValidError if it gives L and E alone."""
        if isinstance(scene.start, SlowStart):
            averages = 0 < scene.stokes < inf and any(scene.start.angular_momentum)
            why = "the start gives L and E but no orientation"
            if averages:
                raise self.refuse(why, averaged_form(scene))
            raise self.refuse(f"{why}: {_WAY_OUT}", "")
        return scene.start

    def require_flow(self, scene: Scene) -> None:
        """Raise FormNotValidError where the flow is not simple shear and the form knows shear alone."""
        if scene.flow is None or self.any_flow:
            return
        # No form of the full equations takes a start without orientation.
        instead = "" if isinstance(scene.start, SlowStart) else full_form(scene)
        condition = f"{scene.flow.words} is not simple shear, which it is derived for"
        raise self.refuse(condition, instead)

    def require_slow_motion(self, scene: Scene, rest: bool = False) -> None:
        """Raise FormNotValidError in other flows than shear, at St = 0 and inf, and unless `rest` at L = 0."""
        self.require_flow(scene)
        if scene.stokes == 0:
            why = "St = 0 has no slow variables"
            instead = "jeffery"
        elif scene.torque_factor == 0:
            why = "at St = inf the slow variables are constant"
            instead = "euler-top"
        elif not rest and not np.any(scene.initial.angular_momentum):
            why = "the start has L = 0, where averaging does not apply"
            instead = full_form(scene)
        else:
            return
        if isinstance(scene.start, SlowStart):
            # No form follows a start without orientation where none averages.
            raise self.refuse(f"{why}: {_WAY_OUT}", "")
        raise self.refuse(why, instead)

    def slow_problem(
        self,
        scene: Scene,
        field: Factory,
        start: Floats,
        parameters: Floats,
        invariant: Invariant | None = None,
    ) -> Problem:
        """Initial value problem in slow time t₂ = t/St; field, start, parameters and invariant as in `Problem`."""
        unit = scene.stokes
        return Problem(
            self.name,
            field,
            start,
            scene.slow_time,
            parameters,
            invariant=invariant,
            time_unit=unit,
        )

    def refuse(self, condition: str, instead: str) -> FormNotValidError:
        """Make the error that says which condition failed and which form to use instead."""
        return FormNotValidError(condition, self.name, instead)
