"""A study: scenes × forms × solvers × tolerances, as data."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from importlib.resources import files
from math import inf
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from polhode.harness.studies.case import Case
from polhode.models.catalogue import FORMS
from polhode.models.catalogue import form as find_form
from polhode.models.form import FormNotValidError
from polhode.models.scene import Scene
from polhode.models.scene_file import Positive, parse_scene, scene_table
from polhode.models.scenes import named_scene
from polhode.models.toml_file import checked, read_toml
from polhode.solvers.catalogue import SOLVERS
from polhode.solvers.catalogue import solver as find_solver
from polhode.solvers.contract import Backend, Jacobian, SolverNotValidError

QUICK_SECONDS = 0.2
# What a study may say of a built-in scene.
BESIDE_BUILTIN = ("time", "tags", "forms", "solvers", "max_seconds")


def _as_list(value: Any) -> Any:
    return value if isinstance(value, list) else [value]


Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$")]
Stokes = Annotated[float, Field(ge=0)]
Page = Literal["costs", "outcomes"]
"""What the page of a study is about: which run is the cheapest, or who gets through."""


class StudySceneTable(BaseModel):
    """``[[scenes]]``: a scene file's contents with a name, and one or several Stokes numbers.

    ``{name = "pinch-point", builtin = true}`` stands for a built-in scene, `time` beside it for another duration. Tags
    are what a run may be limited to; forms and solvers, some of the study's, limit those of the scene; `max_seconds`
    is a time limit of its own.
    """

    model_config = ConfigDict(extra="allow", strict=True)
    name: Name
    stokes: Annotated[list[Stokes], Field(min_length=1), BeforeValidator(_as_list)]
    tags: list[str] = []
    forms: Annotated[list[str], Field(min_length=1)] | None = None
    solvers: Annotated[list[str], Field(min_length=1)] | None = None
    max_seconds: Positive | None = None


class StudyTable(BaseModel):
    """A study file; its name is that of the folder of its results."""

    model_config = ConfigDict(extra="forbid", strict=True)
    name: Name
    title: str
    samples: Annotated[int, Field(ge=2)] = 501
    max_seconds: Positive = 10.0
    tolerances: Annotated[list[Positive], Field(min_length=1)]
    forms: Annotated[list[str], Field(min_length=1)]
    solvers: Annotated[list[str], Field(min_length=1)] = list(SOLVERS)
    backends: Annotated[list[Backend], Field(min_length=1)] | None = None
    jacobians: Annotated[list[Jacobian], Field(min_length=1)] | None = None
    page: Page | None = None
    scenes: Annotated[list[StudySceneTable], Field(min_length=1)]

    @model_validator(mode="after")
    def _known_names(self) -> "StudyTable":
        for kind, names, known, find in (
            ("forms", self.forms, FORMS, find_form),
            ("solvers", self.solvers, SOLVERS, find_solver),
        ):
            for name in names:
                if ":" in name:
                    _outside(kind, name, find)
                elif name not in known:
                    raise ValueError(f"got {name!r} in {kind}, expected some of {', '.join(known)}, or module:class")
        for scene in self.scenes:
            for kind, own, known in (("forms", scene.forms, self.forms), ("solvers", scene.solvers, self.solvers)):
                for name in own or ():
                    if name not in known:
                        expected = f"some of the study's: {', '.join(known)}"
                        raise ValueError(f"got {name!r} in {kind} of scene {scene.name!r}, expected {expected}")
        return self

    @model_validator(mode="after")
    def _nothing_twice(self) -> "StudyTable":
        scenes = [(scene.name, stokes) for scene in self.scenes for stokes in scene.stokes]
        lists = {"forms": self.forms, "solvers": self.solvers, "tolerances": self.tolerances, "scenes": scenes}
        for kind, values in lists.items():
            for value in values:
                if values.count(value) > 1:
                    raise ValueError(f"got {value!r} {values.count(value)} times in {kind}, expected it once")
        return self


@dataclass(frozen=True)
class Choice:
    """What a study says of one scene: its tags, forms and solvers if it is limited to some, and time limit."""

    tags: tuple[str, ...] = ()
    forms: tuple[str, ...] | None = None
    solvers: tuple[str, ...] | None = None
    max_seconds: float | None = None


ANY = Choice()


@dataclass(frozen=True)
class Study:
    """What to measure: every solver on every form of every scene, from the loosest tolerance to the tightest.

    Where back ends or Jacobians are named, every solver runs with each of them that it offers; else with its first one.
    Choices belong to a scene's name and St.
    """

    name: str
    title: str
    scenes: tuple[tuple[str, Scene], ...]
    forms: tuple[str, ...]
    solvers: tuple[str, ...]
    tolerances: tuple[float, ...]
    samples: int
    max_seconds: float
    backends: tuple[Backend, ...] | None = None
    jacobians: tuple[Jacobian, ...] | None = None
    choices: Mapping[tuple[str, float], Choice] = field(default_factory=dict)
    page: Page = "costs"
    # Averaged equations are not tried over more slow time than this.
    longest_slow_time: float = inf

    def batches(self) -> Iterator[list[Case]]:
        """Cases in batches that are timed in interleaved order: one scene, form and tolerance, all solvers."""
        for scene_name, scene in self.scenes:
            choice = self.choice(scene_name, scene)
            for form_name in self.forms:
                if choice.forms is not None and form_name not in choice.forms:
                    continue
                if scene.slow_time > self.longest_slow_time and find_form(form_name).averaged:
                    continue
                try:
                    problem = find_form(form_name).problem(scene)
                except FormNotValidError:
                    continue
                accepted = []
                for solver_name in self.solvers:
                    if choice.solvers is not None and solver_name not in choice.solvers:
                        continue
                    try:
                        find_solver(solver_name).check(problem)
                    except SolverNotValidError:
                        continue
                    accepted.append(solver_name)
                for tolerance in sorted(self.tolerances, reverse=True):
                    yield [
                        Case(
                            scene_name,
                            scene,
                            form_name,
                            solver_name,
                            tolerance,
                            self.samples,
                            choice.max_seconds or self.max_seconds,
                            backend,
                            jacobian,
                            choice.tags,
                        )
                        for solver_name in accepted
                        for backend, jacobian in self._ways(solver_name)
                    ]

    def choice(self, scene_name: str, scene: Scene) -> Choice:
        """What the study says of a scene."""
        return self.choices.get((scene_name, scene.stokes), ANY)

    def _ways(self, solver_name: str) -> list[tuple[Backend | None, Jacobian | None]]:
        """Back ends and Jacobians with which to run a solver."""
        solver = find_solver(solver_name)
        offered = set(solver.backends), set(solver.jacobians)
        backends: list[Backend | None] = [name for name in self.backends or () if name in offered[0]]
        jacobians: list[Jacobian | None] = [name for name in self.jacobians or () if name in offered[1]]
        if self.backends is None:
            backends = [None]
        return [(backend, jacobian) for backend in backends for jacobian in jacobians or [None]]


def read_study(path: Path | None, default: str = "bench") -> Study:
    """Read a study file, or the one of the given name that comes with the package; raises as `read_toml` does."""
    own = files("polhode.harness.studies") / f"{default}.toml"
    return read_toml(path or own, parse_study, where=None if path else f"study {default!r}")


def quick_study(study: Study) -> Study:
    """The same study with every other tolerance and short time limits, for a look."""
    choices = {scene: replace(choice, max_seconds=None) for scene, choice in study.choices.items()}
    seconds = min(study.max_seconds, QUICK_SECONDS)
    return replace(study, tolerances=study.tolerances[::2], max_seconds=seconds, choices=choices)


def _outside(kind: str, name: str, find: Callable[[str], object]) -> None:
    """Refuse a "module:class" that cannot be found, in the words of study files."""
    try:
        find(name)
    except ValueError as error:
        raise ValueError(f"got {name!r} in {kind}, {str(error).partition(', ')[2]}") from None


def parse_study(contents: dict[str, Any]) -> Study:
    """Make a study of the contents of a study file.

    Raises
    ------
    ValueError
        In one line: the key, the value and what was expected; or that no form and solver fit any scene.
    """
    contents = _with_builtin_scenes(contents)
    table = checked(StudyTable, contents)
    study = Study(
        table.name,
        table.title,
        tuple(scene for position, scenes in enumerate(table.scenes) for scene in _scenes(position, scenes)),
        tuple(table.forms),
        tuple(table.solvers),
        tuple(table.tolerances),
        table.samples,
        table.max_seconds,
        tuple(table.backends) if table.backends else None,
        tuple(table.jacobians) if table.jacobians else None,
        {(scene.name, stokes): _choice(scene) for scene in table.scenes for stokes in scene.stokes},
        # Which is the cheapest makes sense for one scene; several ask who gets through.
        table.page or ("costs" if len({scene.name for scene in table.scenes}) == 1 else "outcomes"),
    )
    if not any(study.batches()):
        raise ValueError(f"forms: got {list(study.forms)}, expected one that some scene and solver accept")
    return study


def _choice(table: StudySceneTable) -> Choice:
    forms, solvers = (None if names is None else tuple(names) for names in (table.forms, table.solvers))
    return Choice(tuple(table.tags), forms, solvers, table.max_seconds)


def _with_builtin_scenes(contents: dict[str, Any]) -> dict[str, Any]:
    """The contents with every ``{name = "…", builtin = true}`` among the scenes spelled out."""
    scenes = contents.get("scenes")
    if not isinstance(scenes, list):
        return contents
    return {**contents, "scenes": [_spelled_out(position, scene) for position, scene in enumerate(scenes)]}


def _spelled_out(position: int, scene: Any) -> Any:
    if not (isinstance(scene, dict) and scene.get("builtin") is True):
        return scene
    if not {"name", "builtin"} <= set(scene) <= {"name", "builtin", *BESIDE_BUILTIN}:
        expected = f"name, builtin and perhaps {', '.join(BESIDE_BUILTIN)}"
        raise ValueError(f"scenes[{position}]: got {sorted(scene)}, expected {expected}")
    own = {key: value for key, value in scene.items() if key in BESIDE_BUILTIN}
    try:
        return {"name": scene["name"], **scene_table(named_scene(scene["name"])), **own}
    except ValueError as error:
        raise ValueError(f"scenes[{position}]: {error}") from None


def _scenes(position: int, table: StudySceneTable) -> Iterator[tuple[str, Scene]]:
    for stokes in table.stokes:
        try:
            yield table.name, parse_scene({"stokes": stokes, **(table.model_extra or {})})
        except ValueError as error:
            raise ValueError(f"scenes[{position}]: {error}") from None
