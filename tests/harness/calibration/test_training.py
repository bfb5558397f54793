"""What laws lack is what is measured: methods unknown or changed, and the long stratum."""

from dataclasses import replace

from polhode.harness.calibration.scenes import TRAINING_SEED, questions
from polhode.harness.calibration.training import EVERY_LONG, lacking, studies, training, without
from polhode.harness.common.store import Store
from polhode.harness.picking.laws import Laws, load_laws
from polhode.harness.picking.pilot import pilot
from polhode.solvers.catalogue import solver


def measured(base: Laws | None) -> set[tuple[str, str]]:
    """Methods measured of the first short scene, by laws that are to be added to."""
    return {(case.form, case.solver) for batch in training(1, base) for case in batch}


def test_only_what_laws_lack_is_measured():
    laws = load_laws()
    whole = measured(None)
    gone = next(name for name in whole if not lacking(laws, *name))
    for methods in (
        {name: law for name, law in laws.methods.items() if name != gone},
        laws.methods | {gone: replace(laws.methods[gone], stale=True)},
    ):
        found = measured(replace(laws, methods=methods))
        assert found == {name for name in whole if lacking(laws, *name)} | {gone}


def test_what_has_changed_is_forgotten(tmp_path):
    laws = load_laws()
    with Store(tmp_path / "training.sqlite") as store:
        for key, form, name in (
            ("a", "hybrid", "taylor"),
            ("b", "quaternion", "taylor"),
            ("c", "quaternion", "ida"),
        ):
            store.put(key, {"form": form, "solver": name}, {})
        left = without(store, laws, ("hybrid", "ida"))
        assert store.keys() == {"b"}
    assert left is not None
    assert left.methods.keys() == {
        name for name in laws.methods if name[0] != "hybrid" and name[1] != "ida"
    }


def test_long_runs_are_left_to_quick_methods():
    # A spheroid over 9e4 rotations, a triaxial body over 7e3.
    asked = questions(TRAINING_SEED, 7, "long")[5:]
    assert min(pilot(each.scene).rotations for each in asked) > EVERY_LONG
    parts = [part for question in asked for part in studies(question, 0, "long")]
    full = [part for part in parts if part.forms[0] in ("quaternion", "spheroid-axis")]
    assert full
    assert not any(
        solver(name).implicit or solver(name).low_order for part in full for name in part.solvers
    )
