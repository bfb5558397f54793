"""A study: scenes × forms × solvers × tolerances, as data."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from math import inf
from typing import Literal

from polhode.harness.studies.case import Case
from polhode.models.catalogue import form as find_form
from polhode.models.form import FormNotValidError
from polhode.models.scene import Scene
from polhode.solvers.catalogue import solver as find_solver
from polhode.solvers.contract import Backend, Jacobian

QUICK_SECONDS = 0.2
Page = Literal["costs", "outcomes", "known-stokes"]
"""What a page is about: the cheapest run, who gets through, or what solvers gain that know St."""


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
    """Every solver, by each back end and Jacobian named, on every form of every scene, from loose to tight."""

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
    reference_seconds: float = inf
    counted: bool = True

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
                wanted = (name for name in self.solvers if choice.solvers is None or name in choice.solvers)
                accepted = [name for name in wanted if find_solver(name).takes(problem)]
                for tolerance in sorted(self.tolerances, reverse=True):
                    limits = tolerance, self.samples, choice.max_seconds or self.max_seconds
                    others = choice.tags, self.reference_seconds, self.counted
                    yield [
                        Case(scene_name, scene, form_name, solver_name, *limits, backend, jacobian, *others)
                        for solver_name in accepted
                        for backend, jacobian in self._ways(solver_name)
                    ]

    def choice(self, scene_name: str, scene: Scene) -> Choice:
        """What the study says of a scene."""
        return self.choices.get((scene_name, scene.stokes), ANY)

    def part(
        self,
        *,
        scenes: Iterable[str] = (),
        tags: Iterable[str] = (),
        forms: Iterable[str] = (),
        solvers: Iterable[str] = (),
    ) -> "Study":
        """What meets every filter, none of a kind meaning all; ValueError for unknown names, or if nothing is left."""
        wanted = {
            "scene": _known("scene", scenes, {name for name, _ in self.scenes}),
            "tag": _known("tag", tags, {tag for own in self.choices.values() for tag in own.tags}),
            "form": _known("form", forms, self.forms),
            "solver": _known("solver", solvers, self.solvers),
        }

        def kept(kind: str, *names: str) -> bool:
            return not wanted[kind] or not wanted[kind].isdisjoint(names)

        part = replace(
            self,
            scenes=tuple(
                (name, scene)
                for name, scene in self.scenes
                if kept("scene", name) and kept("tag", *self.choice(name, scene).tags)
            ),
            forms=tuple(name for name in self.forms if kept("form", name)),
            solvers=tuple(name for name in self.solvers if kept("solver", name)),
        )
        if not any(part.batches()):
            got = ", ".join(f"{kind} {name}" for kind, names in wanted.items() for name in sorted(names))
            raise ValueError(f"filters: got {got}, expected some that go together in study {self.name!r}")
        return part

    def quick(self) -> "Study":
        """The study with every other tolerance and short time limits, for a look."""
        choices = {scene: replace(choice, max_seconds=None) for scene, choice in self.choices.items()}
        seconds = min(self.max_seconds, QUICK_SECONDS)
        return replace(self, tolerances=self.tolerances[::2], max_seconds=seconds, choices=choices)

    def _ways(self, solver_name: str) -> list[tuple[Backend | None, Jacobian | None]]:
        """Back ends and Jacobians with which to run a solver."""
        solver = find_solver(solver_name)
        offered = {each for each in solver.backends if not solver.lacks(each)}, set(solver.jacobians)
        backends: list[Backend | None] = [name for name in self.backends or () if name in offered[0]]
        jacobians: list[Jacobian | None] = [name for name in self.jacobians or () if name in offered[1]]
        if self.backends is None:
            backends = [None]
        return [(backend, jacobian) for backend in backends for jacobian in jacobians or [None]]


def _known(kind: str, names: Iterable[str], known: Iterable[str]) -> set[str]:
    """Names of a filter; raises ValueError if the study does not know one."""
    for name in names:
        if name not in known:
            expected = f"one of {', '.join(sorted(known))}" if known else f"none, for the study has no {kind}s"
            raise ValueError(f"{kind}: got {name!r}, expected {expected}")
    return set(names)
