"""A study: scenes × forms × solvers × tolerances, as data, and the file in TOML that describes it.

`StudyTable` is the file as pydantic checks it, `Study` what is made of it. `Study.batches` gives its cases
(`polhode.harness.studies.case`), and `polhode.harness.studies.runner` runs them.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from importlib.resources import files
from itertools import chain, product
from math import inf
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, WithJsonSchema, model_validator

from polhode.harness.studies.case import Case
from polhode.models.catalogue import FORMS, form as find_form
from polhode.models.files.scene_file import Positive, parse_scene, scene_table
from polhode.models.files.toml_file import checked, read_toml
from polhode.models.form import FormNotValidError
from polhode.models.registry import NotFoundError, hint
from polhode.models.scene import Scene
from polhode.models.scenes import named_scene
from polhode.solvers.catalogue import SOLVERS, solver as find_solver
from polhode.solvers.contract import Backend, Jacobian

# Rows of a run that is compared with a reference: at most, and by default. Estimates: more rows take much
# memory, between fewer ones the largest error may be missed.
_MAX_SAMPLES = 100_000
_SAMPLES = 501
# Time limit of a run, in seconds: by default, and at most in a quick study. Estimates: slower runs are told
# as too slow.
_RUN_SECONDS = 10.0
_QUICK_SECONDS = 0.2
# Keys that a study may give beside a built-in scene.
_BESIDE_BUILTIN = ("stokes", "time", "slow_time", "tags", "forms", "solvers", "max_seconds")
# Names that a part of a study is limited to; an empty one means all.
Filter = Iterable[str]
# Name of a study, which its folder has, or of a scene, which `--scene` selects.
Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$")]
Stokes = Annotated[float, Field(ge=0)]
# `stokes` may be a number or a list. The schema of the file says so; the list is made by `_AS_LIST`.
_ONE = {"type": "number", "minimum": 0}
_ONE_OR_MORE = WithJsonSchema({"anyOf": [_ONE, {"type": "array", "items": _ONE, "minItems": 1}]})
_AS_LIST = BeforeValidator(lambda value: value if isinstance(value, list) else [value])
StokesNumbers = Annotated[list[Stokes], Field(min_length=1), _AS_LIST, _ONE_OR_MORE]
Page = Literal["costs", "outcomes", "known-stokes", "stiff"]
"""What a page is about: the cheapest run, who gets through, what solvers gain that know St, or the stiff side."""


class Choice(BaseModel):
    """Choices of a study for one scene: its tags, forms and solvers if it is limited to some, and time limit."""

    model_config = ConfigDict(strict=True)
    tags: list[str] = []  # the study's own words, by which `part` selects scenes
    forms: Annotated[list[str], Field(min_length=1)] | None = None
    solvers: Annotated[list[str], Field(min_length=1)] | None = None
    max_seconds: Positive | None = None  # None: the study's


@dataclass(frozen=True)
class Study:
    """Every solver, by each back end and Jacobian named, on every form of every scene, from loose to tight."""

    name: str  # the key in the file; by default the folder of its results has this name
    title: str  # heading of its page
    scenes: tuple[tuple[str, Scene], ...]  # with their names, of which several St share one
    forms: tuple[str, ...]
    solvers: tuple[str, ...]
    tolerances: tuple[float, ...]
    samples: int  # equispaced times of a run, start and end included
    max_seconds: float  # that a run may take
    # A solver runs with the ones of these back ends and Jacobians that it has; with its first one if
    # None is given. Without any of the back ends it is left out. Without any of the Jacobians it
    # runs with its first one: explicit solvers have none.
    backends: tuple[Backend, ...] | None = None
    jacobians: tuple[Jacobian, ...] | None = None
    # By name and St of a scene.
    choices: Mapping[tuple[str, float], Choice] = field(default_factory=dict)
    page: Page = "costs"
    # Averaged equations are not tried over more slow time, t/St, than this (`polhode bench`).
    longest_slow_time: float = inf
    reference_seconds: float = inf  # that a reference may take
    counted: bool = True  # whether first runs count right-hand sides, which is slow

    def batches(self) -> Iterator[list[Case]]:
        """Cases in batches: one scene, form and tolerance, all solvers.

        A batch is timed in interleaved order. Forms and solvers that do not take a scene are left
        out. A batch is empty if no solver takes it: ``any(study.batches())`` says whether there is
        a case at all.
        """
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
                solver_names = (
                    name
                    for name in self.solvers
                    if choice.solvers is None or name in choice.solvers
                )
                accepted = [name for name in solver_names if find_solver(name).takes(problem)]
                for tolerance in sorted(self.tolerances, reverse=True):
                    cases = []
                    for solver_name in accepted:
                        cases += [
                            Case(
                                scene_name=scene_name,
                                scene=scene,
                                form=form_name,
                                solver=solver_name,
                                tolerance=tolerance,
                                samples=self.samples,
                                max_seconds=choice.max_seconds or self.max_seconds,
                                backend=backend,
                                jacobian=jacobian,
                                tags=tuple(choice.tags),
                                reference_seconds=self.reference_seconds,
                                counted=self.counted,
                            )
                            for backend, jacobian in self._compilations(solver_name)
                        ]
                    yield cases

    def choice(self, scene_name: str, scene: Scene) -> Choice:
        """The study's choices for a scene."""
        return self.choices.get((scene_name, scene.stokes), Choice())

    def part(
        self, *, scenes: Filter = (), tags: Filter = (), forms: Filter = (), solvers: Filter = ()
    ) -> "Study":
        """The part within all filters, none of a kind meaning all; ValueError by unknown names, or if it is empty."""
        all_tags = {*chain.from_iterable(choice.tags for choice in self.choices.values())}
        filters = {
            "scene": _known("scene", scenes, {name for name, _ in self.scenes}),
            "tag": _known("tag", tags, all_tags),
            "form": _known("form", forms, self.forms),
            "solver": _known("solver", solvers, self.solvers),
        }

        def passes(kind: str, *names: str) -> bool:
            return not filters[kind] or not filters[kind].isdisjoint(names)

        part = replace(
            self,
            scenes=tuple(
                (name, scene)
                for name, scene in self.scenes
                if passes("scene", name) and passes("tag", *self.choice(name, scene).tags)
            ),
            forms=tuple(name for name in self.forms if passes("form", name)),
            solvers=tuple(name for name in self.solvers if passes("solver", name)),
        )
        if not any(part.batches()):
            named = []
            for kind, names in filters.items():
                named += [f"{kind} {name}" for name in sorted(names)]
            got = ", ".join(named)
            raise ValueError(
                f"filters: got {got}, expected some that go together in study {self.name!r}"
            )
        return part

    def quick(self) -> "Study":
        """The study with every other tolerance and short time limits, for a look.

        The first tolerance of the file stays. Scenes lose time limits of their own, which would
        outweigh the short one.
        """
        choices = {
            scene: choice.model_copy(update={"max_seconds": None})
            for scene, choice in self.choices.items()
        }
        seconds = min(self.max_seconds, _QUICK_SECONDS)
        return replace(self, tolerances=self.tolerances[::2], max_seconds=seconds, choices=choices)

    def _compilations(self, solver_name: str) -> list[tuple[Backend | None, Jacobian | None]]:
        """Pairs of back end and Jacobian with which to run a solver; None stands for its first one."""
        solver = find_solver(solver_name)
        # Back ends whose library is missing are not run either.
        offered = {None, *(backend for backend in solver.backends if not solver.lacks(backend))}
        jacobians: list[Jacobian | None] = [
            name for name in self.jacobians or () if name in solver.jacobians
        ]
        backends: list[Backend | None] = [
            name for name in self.backends or [None] if name in offered
        ]
        return [*product(backends, jacobians or [None])]


def _known(kind: str, names: Filter, available: Iterable[str]) -> set[str]:
    """Names of a filter; raises ValueError if the study does not know one."""
    for name in names:
        if name not in available:
            expected = (
                f"one of {', '.join(sorted(available))}"
                if available
                else f"none, for the study has no {kind}s"
            )
            # A name with a colon is a solver or form as `module:class`.
            own = f"; one of your own stands in the {kind}s of a study file" if ":" in name else ""
            raise ValueError(
                f"{kind}: got {name!r}{hint(name, available)}, expected {expected}{own}"
            )
    return set(names)


class StudySceneTable(Choice):
    """``[[scenes]]``: a scene file's contents with a name, and one or several Stokes numbers.

    ``{name = "pinch-point", builtin = true}`` stands for a built-in scene, `time` or `slow_time`
    beside it for another duration. A run may be limited to scenes with given tags. `forms` and
    `solvers` list the study's that the scene is run with; `max_seconds` is a time limit of its own.
    """

    # A built-in scene needs no stokes. Keys that are no fields here are the scene's: `parse_scene`
    # checks them.
    model_config = ConfigDict(extra="allow", strict=True, json_schema_extra={"required": ["name"]})
    name: Name
    stokes: StokesNumbers

    @model_validator(mode="before")
    @classmethod
    def _spelled_out(cls, scene: Any) -> Any:
        """A built-in scene with its contents."""
        if not (isinstance(scene, dict) and scene.get("builtin") is True):
            return scene
        if not {"name", "builtin"} <= set(scene) <= {"name", "builtin", *_BESIDE_BUILTIN}:
            expected = f"name, builtin and perhaps {', '.join(_BESIDE_BUILTIN)}"
            raise ValueError(f"got {sorted(scene)}, expected {expected}")
        overrides = {
            key: value for key, value in scene.items() if key in ("name", *_BESIDE_BUILTIN)
        }
        builtin = scene_table(named_scene(str(scene["name"])))
        # A scene has a time or a slow time, not both.
        return {
            name: value
            for name, value in builtin.items()
            if name != "time" or "slow_time" not in overrides
        } | overrides


class StudyTable(BaseModel):
    """A study file; by default the folder of its results has its `name`."""

    model_config = ConfigDict(extra="forbid", strict=True)
    name: Name
    title: str
    samples: Annotated[int, Field(ge=2, le=_MAX_SAMPLES)] = _SAMPLES
    max_seconds: Positive = _RUN_SECONDS
    tolerances: Annotated[list[Positive], Field(min_length=1)]
    forms: Annotated[list[str], Field(min_length=1)]
    solvers: Annotated[list[str], Field(min_length=1)] = list(SOLVERS)
    backends: Annotated[list[Backend], Field(min_length=1)] | None = None
    jacobians: Annotated[list[Jacobian], Field(min_length=1)] | None = None
    page: Page | None = None
    scenes: Annotated[list[StudySceneTable], Field(min_length=1)]

    @model_validator(mode="after")
    def _known_names(self) -> "StudyTable":
        """The table, if forms and solvers exist, and scenes name the study's alone."""
        for kind, names, catalogue in (
            ("forms", self.forms, FORMS),
            ("solvers", self.solvers, SOLVERS),
        ):
            for name in (unlisted for unlisted in names if unlisted not in catalogue):
                try:
                    catalogue.find(name)
                except NotFoundError as error:
                    raise ValueError(
                        f"got {name!r}{error.advice} in {kind}, expected {error.expected}"
                    ) from None
        for scene in self.scenes:
            for kind, chosen, study_names in (
                ("forms", scene.forms, self.forms),
                ("solvers", scene.solvers, self.solvers),
            ):
                for name in chosen or ():
                    if name not in study_names:
                        expected = f"some of the study's: {', '.join(study_names)}"
                        raise ValueError(
                            f"got {name!r} in {kind} of scene {scene.name!r}, expected {expected}"
                        )
        return self

    @model_validator(mode="after")
    def _nothing_twice(self) -> "StudyTable":
        """The table, if no form, solver, tolerance, or pair of scene and St stands there twice."""
        scenes = []
        for scene in self.scenes:
            scenes += [(scene.name, stokes) for stokes in scene.stokes]
        lists = {
            "forms": self.forms,
            "solvers": self.solvers,
            "tolerances": self.tolerances,
            "scenes": scenes,
        }
        for kind, values in lists.items():
            for value in values:
                if values.count(value) > 1:
                    raise ValueError(
                        f"got {value!r} {values.count(value)} times in {kind}, expected it once"
                    )
        return self


def read_study(path: Path | None, default: str = "bench") -> Study:
    """Read a study file, or the one of the given name that comes with the package; raises as `read_toml` does."""
    built_in = files("polhode.harness.studies") / f"{default}.toml"
    parse = partial(parse_study, folder=path.parent) if path else parse_study
    return read_toml(path or built_in, parse, where=None if path else f"study {default!r}")


def parse_study(contents: dict[str, Any], folder: Path = Path()) -> Study:
    """The study that a file's contents describe.

    Files of tracks (docs/flows.md) that its scenes name are sought in the folder. Raises
    ValueError, in one line, if a key is wrong or no solver takes any scene and form.
    """
    table = checked(StudyTable, contents)
    # The table's keys are fields of `Study`; scenes and page are set below.
    settings: dict[str, Any] = {
        name: tuple(value) if isinstance(value, list) else value for name, value in table
    }
    settings["scenes"] = ()
    for position, scene_entry in enumerate(table.scenes):
        try:
            scenes = [
                parse_scene({"stokes": stokes, **(scene_entry.model_extra or {})}, folder)
                for stokes in scene_entry.stokes
            ]
        except ValueError as error:
            raise ValueError(f"scenes[{position}]: {error}") from None
        settings["scenes"] += tuple((scene_entry.name, scene) for scene in scenes)
    settings["choices"] = {}
    for scene_entry in table.scenes:
        for stokes in scene_entry.stokes:
            settings["choices"][scene_entry.name, stokes] = scene_entry
    # By default a study of one scene asks for the cheapest run, one of several who gets through.
    settings["page"] = table.page or (
        "costs" if len({scene.name for scene in table.scenes}) == 1 else "outcomes"
    )
    study = Study(**settings)
    if not any(study.batches()):
        raise ValueError(
            f"forms: got {list(study.forms)}, expected one that some scene and solver accept"
        )
    return study
