"""First runs, in processes of their own."""

from polhode.harness.studies.cost import compile_group, first_runs, first_seconds
from polhode.models.catalogue import form
from polhode.models.scenes import named_scene


def test_first_runs_pay_for_compilation_and_a_group_is_measured_once():
    scene = named_scene("paper")
    found = first_seconds({"quaternion": scene}, [("quaternion", "cyrk-vern8"), ("quaternion", "cyrk-radau")])
    assert found["quaternion", "cyrk-vern8"] == found["quaternion", "cyrk-radau"] > 0.05
    [(cold, warm)] = first_runs(form("quaternion").problem(scene), ["cyrk-vern8"]).values()
    assert cold.compilation > 10 * cold.run
    assert warm.compilation > 0.0


def test_groups_share_what_is_compiled():
    assert compile_group("cyrk-vern8") == compile_group("cyrk-radau")
    assert compile_group("radau") == compile_group("bdf") != compile_group("dop853")
