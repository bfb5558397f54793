"""First runs, in processes of their own."""

from dataclasses import replace

from polhode.harness.studies.cost import first_runs
from polhode.models.catalogue import form
from polhode.models.scenes import named_scene


def test_first_runs_pay_for_compilation():
    problem = replace(form("quaternion").problem(named_scene("paper")), end=1.0)
    [(cold, warm)] = first_runs(problem, ["taylor"]).values()
    assert cold.compilation > cold.run, "compiling takes longer than a short run"
    assert cold.compilation > warm.compilation > 0.0, "heyoka keeps compiled code on disk"


def test_segments_are_compiled_too():
    scene = named_scene("long")
    compilation = {}
    for name in ("quaternion", "hybrid"):
        problem = form(name).problem(scene)
        beginning = replace(problem, end=1e-6 * problem.end, least_steps=0)
        [(cold, _)] = first_runs(beginning, ["cyrk-vern8"]).values()
        compilation[name] = cold.compilation
    assert compilation["hybrid"] > 3 * compilation["quaternion"]
