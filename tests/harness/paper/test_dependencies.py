"""What an item's data depend on: found by import, with the catalogue entries that code names."""

import ast
from dataclasses import replace

import pytest

from polhode.harness.paper import dependencies, store
from polhode.harness.paper.claims import find_items
from polhode.harness.paper.dependencies import code_key, files_of, meaning, reached_from
from polhode.harness.paper.item import Grid

LIMITS = "polhode.harness.paper.sections.limits"


def reached(item):
    kind = type(item.experiment)
    return reached_from(kind.__module__, kind.__qualname__)


def test_the_key_knows_settings_and_grid():
    first, second = find_items(("spheroid-slow-1", "spheroid-slow-2"))
    keys = {store.content_key(item, grid) for item in (first, second) for grid in Grid}
    assert len(keys) == 4
    other = replace(first, experiment=replace(first.experiment, slow_time=0.4))
    assert store.content_key(other, Grid.FULL) not in keys


def test_what_judges_and_draws_is_no_part_of_the_key():
    (item,) = find_items(("spheroid-slow-1",))
    looser = replace(item.experiment.relative, high=2.0)
    other = replace(item, experiment=replace(item.experiment, relative=looser))
    assert store.content_key(other, Grid.FULL) == store.content_key(item, Grid.FULL)
    names = {name for _, name in reached(item).definitions}
    assert {"SlowMotion", "averaged_run", "RUN_TOLERANCE"} <= names
    assert not {"draw_each", "FALLS_LIKE_INVERSE", "panels"} & names


def test_when_an_item_begins_is_no_part_of_the_key():
    (item,) = find_items(("poincare-flat",))
    kept = dependencies._computing(dependencies._definitions(LIMITS)["_Sections"])
    assert item.experiment.seconds > 10
    assert "seconds" not in ast.unparse(kept)
    assert "isotropic" in ast.unparse(kept)


def test_modules_are_found_by_import_and_by_catalogue_names():
    (item,) = find_items(("spheroid-slow-1",))
    modules = reached(item).modules
    assert {"polhode.solvers.solve", "polhode.solvers.taylor"} <= modules
    assert "polhode.models.forms.spheroid_axis" in modules
    assert not {name for name in modules if "sundials" in name or "hybrid" in name}
    (pinch,) = find_items(("spheroid-pinch",))
    assert "polhode.models.hybrid.form" in reached(pinch).modules


def test_data_that_code_reads_are_part_of_the_key():
    (item,) = find_items(("spheroid-slow-1",))
    names = {path.name for path in files_of(reached(item))}
    assert {"callback.ll", "methods.toml", "solve.py"} <= names


def test_a_changed_module_changes_the_keys_of_those_that_use_it(monkeypatch):
    spheroid, sphere = find_items(("spheroid-slow-1", "averages-spheroid"))
    before = [code_key(item.experiment) for item in (spheroid, sphere)]

    def changed(path):
        return meaning(path) + ("changed" if path.name == "taylor.py" else "")

    monkeypatch.setattr(dependencies, "meaning", changed)
    dependencies._key_of.cache_clear()
    after = [code_key(item.experiment) for item in (spheroid, sphere)]
    dependencies._key_of.cache_clear()
    assert before[0] != after[0]


@pytest.mark.parametrize(
    ("ending", "texts"),
    [
        (
            "py",
            [
                'def f():\n    "One."\n    return 1\n',
                'def f():  # two\n    "Two."\n\n    return 1\n',
                "def f():\n    return 2\n",
            ],
        ),
        ("toml", ['a = ["z1"]', 'a = ["z1"] # the same', 'a = ["z2"]']),
    ],
)
def test_the_key_follows_code_alone(tmp_path, ending, texts):
    """Docstrings and comments may change, a number may not."""
    paths = [tmp_path / f"{number}.{ending}" for number in range(3)]
    for path, text in zip(paths, texts, strict=True):
        path.write_text(text)
    first, second, third = (meaning(path) for path in paths)
    assert first == second != third
