"""Filters: the part of a study that somebody wants to run."""

from collections.abc import Iterable
from dataclasses import replace

from polhode.harness.studies.study import Study
from polhode.models.scene import Scene


def chosen(
    study: Study,
    *,
    scenes: Iterable[str] = (),
    tags: Iterable[str] = (),
    forms: Iterable[str] = (),
    solvers: Iterable[str] = (),
) -> Study:
    """The part of a study that meets every filter; none of a kind means all.

    Raises
    ------
    ValueError
        If a filter names what the study does not have, or nothing is left.
    """
    offered = {
        "scene": (scenes, {name for name, _ in study.scenes}),
        "tag": (tags, {tag for own in study.choices.values() for tag in own.tags}),
        "form": (forms, study.forms),
        "solver": (solvers, study.solvers),
    }
    wanted = {kind: _offered(kind, names, known) for kind, (names, known) in offered.items()}

    def kept(name: str, scene: Scene) -> bool:
        own = study.choice(name, scene).tags
        return (not wanted["scene"] or name in wanted["scene"]) and (
            not wanted["tag"] or not wanted["tag"].isdisjoint(own)
        )

    part = replace(
        study,
        scenes=tuple(pair for pair in study.scenes if kept(*pair)),
        forms=tuple(name for name in study.forms if not wanted["form"] or name in wanted["form"]),
        solvers=tuple(name for name in study.solvers if not wanted["solver"] or name in wanted["solver"]),
    )
    if not any(part.batches()):
        told = ", ".join(f"{kind} {name}" for kind, names in wanted.items() for name in sorted(names))
        raise ValueError(f"filters: got {told}, expected some that go together in study {study.name!r}")
    return part


def _offered(kind: str, names: Iterable[str], known: Iterable[str]) -> set[str]:
    expected = f"one of {', '.join(sorted(known))}" if known else f"none, for the study has no {kind}s"
    for name in names:
        if name not in known:
            raise ValueError(f"{kind}: got {name!r}, expected {expected}")
    return set(names)
