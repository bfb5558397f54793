"""The motion itself: an axis on the unit sphere beside the L_z–E plane, linked in time.

This module computes the data, and `motion.js` draws them. The drawn axis is the symmetry axis of a
spheroid, the longest one of a triaxial body. Constants of the drawing are chosen by eye.
"""

import tomllib
from collections.abc import Callable
from dataclasses import replace
from math import inf, pi
from pathlib import Path
from typing import Any

import numpy as np

from polhode.harness.answers.rules import simplest
from polhode.harness.api import solve
from polhode.harness.pages.tables import fill
from polhode.harness.references.rotations import rotations
from polhode.harness.site.markup import Page, html
from polhode.harness.solution import SceneSolution
from polhode.models.catalogue import averaged_form, form
from polhode.models.form import FormNotValidError
from polhode.models.scene import Scene, start_from
from polhode.models.scenes import named_scene
from polhode.solvers.contract import SolverNotValidError

_PER_ROTATION = 80  # Samples of a rotation that make a smooth path.
# Fewest and most samples of a motion, so that the page has a moderate size.
_FEWEST = 400
_MOST = 3000
# Torque-free paths of a motion: number of samples that begin one, rotations of a path, points of a
# rotation.
_PATHS = 24
_PATH_ROTATIONS = 4
_PATH_POINTS = 40
_TOLERANCE = 1e-10  # Of all runs: far tighter than a screen shows.
_PATH_TOLERANCE = 1e-9  # Of the torque-free ones, whose closed form ignores it.
# Degrees between an axis and the vorticity, or the plane across it, that still count as along it.
_ALONG = 15.0
# Decimals of numbers in the data: most are components of unit vectors. Fewer make the page smaller. In
# `motion.js` the sphere's radius is 193 pixels at most: a pixel is 0.005 of it.
_DECIMALS = 4
_FEW_DECIMALS = 3


def examples() -> dict[str, Scene]:
    """Motions to show, by name: built-in scenes with the changes that `motions.toml` lists."""
    listed = tomllib.loads(Path(__file__).with_name("motions.toml").read_text("utf-8"))
    return {
        name: replace(named_scene(changes.pop("scene")), **changes)
        for name, changes in listed.items()
    }


def motion_page(user_scenes: dict[str, Scene], say: Callable[[str], None]) -> Page:
    """The page of motions: the user's scenes by name first, then the examples; `say` receives a line for each."""
    motions = []
    for name, scene in {**user_scenes, **examples()}.items():
        say(f"motion: {name}")
        motions.append({"name": name, **motion(scene)})
    shown = {"motion-data": [drawing for drawing in motions if "samples" in drawing]}
    scripts = ("chart.js", "motion.js")
    return Page("See it move", fill("site-motion"), html("motion", motions=motions), shown, scripts)


def motion(scene: Scene) -> dict[str, Any]:
    """Data for the drawing of a scene; `why` instead if it has no orientation or cannot be solved.

    `motion.js` reads them by these keys. `time` is the scene's end, in inverse shear rates. `pole` is the index
    of the drawn axis, 0 to 2, and `symmetry` the index of the symmetry axis, None for a triaxial body. `semi` has the
    semi-axes over the longest one. `axis` and `L` are the directions of the drawn axis and of L, three numbers a
    sample. `rows` has the body's first two axes, six numbers a sample, of a triaxial body. `plane` has L_z and E
    over I_max, and `averaged` the same by the averaged equations, an empty list without these. `circle` says
    that the axis goes round L on a circle without torque; a triaxial body has `paths` instead. `parabolas` are
    factors f of E = f L_z²/2, in these units: the least and the largest energy of a body with L along z.
    `samples` is the number of samples and `stokes` St. `says` describes the motion in words, and `how` tells
    form, solver and tolerance.
    """
    if scene.ellipsoid.kind == "sphere":
        return {"why": "a sphere has no axis"}
    try:
        samples = int(min(max(_PER_ROTATION * rotations(scene), _FEWEST), _MOST))
        # The simplest form that has an axis, far more accurate than a screen shows.
        name = simplest(scene)
        problem = form(name).problem(scene)
        # Without parameters a problem has its mass form alone, which IDA takes.
        stepping = "ida" if problem.parameters is None else "taylor"
        solver = "exact" if problem.closed_form else stepping
        solution = solve(scene, form=name, solver=solver, tolerance=_TOLERANCE, samples=samples)
    except (ValueError, ArithmeticError) as error:
        return {"why": str(error)}
    if not solution.success:
        return {"why": str(solution.status)}
    symmetry = scene.ellipsoid.symmetry_axis
    axis = int(np.argmax(scene.ellipsoid.semi_axes)) if symmetry is None else symmetry
    length = np.linalg.norm(solution.angular_momentum, axis=1, keepdims=True)
    direction = np.divide(
        solution.angular_momentum, length, out=np.zeros((samples, 3)), where=length > 0
    )
    return {
        "time": scene.time,
        "samples": samples,
        "axis": _rounded(solution.rotation[:, axis]),
        "pole": axis,
        "symmetry": symmetry,
        "semi": _rounded(np.array(scene.ellipsoid.semi_axes) / max(scene.ellipsoid.semi_axes)),
        "rows": _rounded(solution.rotation[:, :2].reshape(samples, 6), _FEW_DECIMALS)
        if symmetry is None
        else None,
        "L": _rounded(direction),
        "plane": _rounded(_plane(solution)),
        "averaged": _averaged(scene),
        "circle": scene.stokes > 0 and scene.ellipsoid.kind in ("prolate", "oblate"),
        "paths": _torque_free(solution, axis)
        if scene.stokes > 0 and scene.ellipsoid.kind == "triaxial"
        else [],
        "parabolas": [1.0, max(scene.ellipsoid.inertia) / min(scene.ellipsoid.inertia)],
        "stokes": scene.stokes,
        "says": _sentence(solution, axis),
        "how": f"{solution.form} by {solution.solver} at tolerance {solution.tolerance:g}",
    }


def _sentence(solution: SceneSolution, axis: int) -> str:
    """How the body moves, in words: turns, where its axis begins and ends, what becomes of L and E.

    The axis is the symmetry axis, or the one of a triaxial body that ends nearest to the vorticity.
    """
    scene = solution.scene
    # The cosines of the body's axes to the vorticity, along z: at the start and at the end.
    cosines = solution.rotation[[0, -1], :, 2]
    name = "symmetry axis"
    nearest = scene.ellipsoid.symmetry_axis
    if nearest is None:
        nearest = int(np.argmax(np.abs(cosines[1])))
        name = f"{('longest', 'middle', 'shortest')[scene.ellipsoid.order.index(nearest)]} axis"
    angles = np.degrees(np.arccos(np.minimum(1.0, np.abs(cosines[:, nearest])))).tolist()
    turns = max(1, round(rotations(scene)))
    plane = _plane(solution)[[0, -1]].T.tolist()
    return fill(
        "site-motion-says",
        scene=scene,
        turns=turns,
        name=name,
        angles=angles,
        along=_ALONG,
        plane=plane,
    )


def _plane(solution: SceneSolution) -> np.ndarray:
    """L_z and E over I_max, shape (n, 2)."""
    return np.column_stack([solution.angular_momentum[:, 2], solution.energy]) / max(
        solution.scene.ellipsoid.inertia
    )


def _averaged(scene: Scene) -> list[float]:
    """L_z and E over I_max along the run by the averaged equations, a flat list; empty where there are none."""
    if not 0 < scene.stokes < inf:
        return []
    try:
        return _rounded(
            _plane(solve(scene, form=averaged_form(scene), solver="taylor", tolerance=_TOLERANCE))
        )
    except (FormNotValidError, SolverNotValidError):
        return []


def _torque_free(solution: SceneSolution, axis: int) -> list[list[float]]:
    """Paths of the body's axis of that index without torque, each starting at one of `_PATHS` equispaced samples.

    A path is the directions of the axis, three numbers a point. It lasts `_PATH_ROTATIONS` times 2π over the
    rate |L|/I of rotation about the middle moment of inertia I.
    """
    ellipsoid = solution.scene.ellipsoid
    points = _PATH_ROTATIONS * _PATH_POINTS + 1
    paths = []
    for k in np.linspace(0, len(solution.times) - 1, _PATHS).astype(int).tolist():
        moment = solution.observables[k : k + 1]
        size = float(np.linalg.norm(moment.angular_momentum))
        if size == 0:
            # At rest it stays where it is.
            resting = np.repeat(moment.rotation[:, axis], points, axis=0)
            paths.append(_rounded(resting, _FEW_DECIMALS))
            continue
        # The period of a rotation, in inverse shear rates.
        turn = 2 * pi * float(np.median(ellipsoid.inertia)) / size
        top = Scene(ellipsoid, inf, start_from(ellipsoid, moment), _PATH_ROTATIONS * turn)
        free = solve(
            top, form="euler-top", solver="exact", tolerance=_PATH_TOLERANCE, samples=points
        )
        paths.append(_rounded(free.rotation[:, axis], _FEW_DECIMALS))
    return paths


def _rounded(values: np.ndarray, decimals: int = _DECIMALS) -> list[float]:
    """The numbers as a flat list; more decimals than a pixel shows would only weigh."""
    return np.round(values, decimals).ravel().tolist()
