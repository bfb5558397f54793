"""What laws lack is what is measured: methods unknown or changed, and the long stratum."""

from dataclasses import replace

from polhode.harness.calibration.scenes import TRAINING_SEED, questions
from polhode.harness.calibration.training import EVERY_LONG, QUICK, lacking, long_studies, missing_studies, studies
from polhode.harness.picking.laws import load_laws
from polhode.harness.picking.pilot import pilot


def test_only_what_laws_lack_is_measured():
    question, laws = questions(TRAINING_SEED, 2)[1], load_laws()
    whole = {(form, solver) for part in studies(question, 1) for form in part.forms for solver in part.solvers}
    gone = next(name for name in whole if not lacking(laws, *name))
    for methods in (
        {name: law for name, law in laws.methods.items() if name != gone},
        laws.methods | {gone: replace(laws.methods[gone], stale=True)},
    ):
        base = replace(laws, methods=methods)
        found = {(f, s) for part in missing_studies(question, 1, base) for f in part.forms for s in part.solvers}
        assert found == {name for name in whole if lacking(laws, *name)} | {gone}


def test_long_runs_are_left_to_quick_methods():
    asked = [each for each in questions(TRAINING_SEED, 12, "long") if pilot(each.scene).rotations > EVERY_LONG]
    parts = [part for question in asked for part in long_studies(question, 0)]
    full = [part for part in parts if part.forms[0] in ("quaternion", "spheroid-axis")]
    assert full
    assert all(set(part.solvers) <= set(QUICK) for part in full)
    assert all(len(part.forms) == 1 for part in parts)
