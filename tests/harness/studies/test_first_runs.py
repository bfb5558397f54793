"""First runs, in processes of their own."""

from dataclasses import replace

from polhode.harness.studies.cost import compile_group, first_runs, first_seconds
from polhode.models.catalogue import form
from polhode.models.scenes import named_scene


def test_first_runs_pay_for_compilation():
    problem = replace(form("quaternion").problem(named_scene("paper")), end=1.0)
    [(cold, warm)] = first_runs(problem, ["taylor"]).values()
    assert cold.compilation > cold.run, "compiling takes longer than a short run"
    assert cold.compilation > warm.compilation > 0.0, "heyoka keeps compiled code on disk"


def test_a_group_is_measured_once():
    found = first_seconds(
        {"quaternion": named_scene("paper")},
        [("quaternion", "cyrk-vern8"), ("quaternion", "cyrk-radau")],
    )
    assert found["quaternion", "cyrk-vern8"] == found["quaternion", "cyrk-radau"] > 0.0


def test_segments_are_compiled_too(tmp_path, monkeypatch):
    monkeypatch.setenv("POLHODE_CACHE", str(tmp_path))
    scenes = {name: named_scene("long") for name in ("quaternion", "hybrid")}
    found = first_seconds(scenes, [(name, "cyrk-vern8") for name in scenes])
    assert found["hybrid", "cyrk-vern8"] > 3 * found["quaternion", "cyrk-vern8"]


def test_groups_share_what_is_compiled():
    assert compile_group("cyrk-vern8") == compile_group("cyrk-radau")
    assert compile_group("radau") == compile_group("bdf") != compile_group("dop853")
