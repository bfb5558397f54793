"""References: known answers, stated uncertainties that hold, and certificates that notice what is wrong."""

from dataclasses import replace
from itertools import chain
from math import inf

import numpy as np
import pytest

from polhode.harness.common import cache
from polhode.harness.common.timing import MAX_REPETITIONS
from polhode.harness.references import certificate, reference as module
from polhode.harness.references.certificate import certify, segments
from polhode.harness.references.errors import errors
from polhode.harness.references.reference import ReferenceFailedError, reference
from polhode.models.catalogue import form as find_form
from polhode.models.scene import BodyStart, Scene
from polhode.models.scenes import named_scene
from polhode.models.shape import Ellipsoid
from polhode.solvers.contract import Status

pytestmark = pytest.mark.usefixtures("quickly_compiled")


@pytest.fixture(autouse=True, scope="module")
def folder(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("POLHODE_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


PAPER = replace(named_scene("paper"), stokes=100.0, time=50.0)
SPHEROID = replace(named_scene("spheroid"), stokes=100.0, time=50.0)


@pytest.mark.parametrize(
    ("scene", "closed"),
    [(replace(PAPER, stokes=inf), "euler-top"), (replace(SPHEROID, stokes=0.0), "jeffery")],
)
def test_a_reference_meets_the_closed_form(scene: Scene, closed: str):
    form = find_form(closed)
    known = reference(scene, "quaternion", 101)
    problem = form.problem(scene)
    assert problem.closed_form is not None
    exact = form.observe(scene, problem.closed_form(known.times))
    found = errors(scene.ellipsoid, exact, known.observables)
    assert found.slow < 1e-14
    assert found.orientation is not None
    assert found.orientation < 1e-13


@pytest.mark.parametrize("scene", [PAPER, SPHEROID], ids=["ellipsoid", "spheroid"])
def test_quadruple_and_long_double_agree_within_the_uncertainty(scene: Scene, monkeypatch):
    tight = reference(scene, "quaternion", 101)
    monkeypatch.setattr(module, "QUADRUPLE_UP_TO_COST", 0.0)
    rough = reference(scene, "quaternion", 101)
    assert (tight.precision, rough.precision) == ("quadruple", "long double")
    found = errors(scene.ellipsoid, rough.observables, tight.observables)
    assert rough.orientation_uncertainty is not None
    assert found.orientation is not None
    # Both are kept in double precision, which the uncertainties leave out.
    assert found.slow <= rough.slow_uncertainty + 2.3e-16
    assert found.orientation <= rough.orientation_uncertainty + 4.5e-16


def test_uncertainty_is_no_smaller_than_what_half_an_ulp_makes():
    known = reference(PAPER, "quaternion", 101)
    assert 1e-18 < known.slow_uncertainty < 1e-14
    assert known.orientation_uncertainty is not None
    assert 1e-17 < known.orientation_uncertainty < 1e-12


@pytest.mark.parametrize(
    ("scene", "form", "by"),
    [
        (PAPER, "quaternion", ("euler-angles", "cyrk-vern8")),
        (SPHEROID, "quaternion", ("spheroid-axis", "cyrk-vern8")),
        (replace(PAPER, stokes=1e-2, time=1.0), "quaternion", ("euler-angles", "cyrk-vern8")),
        (replace(PAPER, stokes=0.0), "quaternion", ("euler-angles", "ida")),
        (replace(SPHEROID, stokes=0.0), "jeffery", ("jeffery", "exact")),
        (PAPER, "averaged", ("averaged", "cyrk-vern8")),
        (SPHEROID, "averaged-spheroid", ("averaged-spheroid", "cyrk-vern8")),
    ],
)
def test_references_are_certified_by_another_form_and_method(
    scene: Scene, form: str, by: tuple[str, str]
):
    found = reference(scene, form, 11).certificate
    assert (found.form, found.solver) == by
    assert found.segments >= 20
    assert 0 < found.ratio <= 1
    assert found.back == (0 if scene.stokes == 0 else 24)


@pytest.mark.parametrize("component", range(7))
def test_a_certificate_notices_a_wrong_state(component: int, monkeypatch):
    honest = module.extended_run

    def lying(problem, times, precision, tolerance, deadline=inf):
        rows = honest(problem, times, precision, tolerance, deadline)
        rows[len(rows) // 2 :, component] += 1e-9
        return rows

    monkeypatch.setattr(module, "extended_run", lying)
    monkeypatch.setattr(cache, "save", lambda key, arrays: arrays)
    with pytest.raises(
        ReferenceFailedError, match="differs from form 'euler-angles' by cyrk-vern8"
    ):
        reference(replace(PAPER, time=49.0), "quaternion", 11)


def test_a_certificate_takes_no_nan_for_agreement(monkeypatch: pytest.MonkeyPatch):
    form, scene = find_form("quaternion"), replace(PAPER, time=10.0)
    problem = form.problem(scene)
    times = [time for segment in segments(scene, form, problem.end) for time in segment]
    monkeypatch.setattr(certificate, "_other_form", lambda *_: float("nan"))
    with pytest.raises(ReferenceFailedError, match="nan times the method's error"):
        certify(scene, form, problem, dict.fromkeys(times, np.array(problem.start)))


def test_a_certificate_notices_wrong_equations():
    scene = replace(PAPER, time=10.0)
    form = find_form("quaternion")
    wrong = form.problem(replace(scene, stokes=scene.stokes * (1 + 1e-7)))
    times = np.unique([*chain(*segments(scene, form, wrong.end)), wrong.end])
    states = module.extended_run(wrong, times, "long double", 1e-19)
    with pytest.raises(ReferenceFailedError, match="times the method's error"):
        certify(scene, form, wrong, dict(zip(times.tolist(), states, strict=True)))


def test_rounding_of_many_steps_is_allowed_for_and_hides_no_larger_error():
    """√n ulps of L and E instead of n would refuse the honest state."""
    disc = replace(named_scene("spheroid"), ellipsoid=Ellipsoid((1.0, 1.0, 0.1)))
    scene, form = replace(disc, stokes=3e5, time=500.0), find_form("quaternion")
    rows = module.extended_run(form.problem(scene), np.array([0.0, 500.0]), "long double", 1e-19)
    before, after = (certificate.observe(form, scene, row[None]) for row in rows)
    off = replace(after, angular_momentum=after.angular_momentum + 1e-11)
    by = certificate.opposite(scene, form)
    honest, wrong = (
        certificate._other_form(scene, *by, before, each, 500.0) for each in (after, off)
    )
    assert honest <= 1 < wrong


@pytest.mark.parametrize("name", ["paper", "plate", "stiff", "rest-1e8", "long"])
def test_segments_that_go_back_do_not_amplify(name: str):
    scene = named_scene(name)
    for start, end, back in segments(scene, find_form("quaternion"), scene.time):
        assert 0 <= start < back <= end <= scene.time * (1 + 1e-15)
        assert max(scene.ellipsoid.damping) * (back - start) / scene.stokes < 5


def test_a_second_call_reads_the_cache_and_a_damaged_file_is_computed_anew(monkeypatch, capsys):
    first = reference(PAPER, "quaternion", 21)
    monkeypatch.setattr(
        module, "_compute", lambda *arguments: pytest.fail("computed though cached")
    )
    second = reference(PAPER, "quaternion", 21)
    assert second.observables.rotation.tobytes() == first.observables.rotation.tobytes()
    # Sums over other strides differ in their last bit.
    assert second.observables.rotation.strides == first.observables.rotation.strides
    assert (second.slow_uncertainty, second.certificate) == (
        first.slow_uncertainty,
        first.certificate,
    )
    monkeypatch.undo()
    key = module._key(find_form("quaternion").problem(PAPER), 21)
    path = cache.path_of(key)
    path.write_bytes(path.read_bytes()[:-1])
    third = reference(PAPER, "quaternion", 21)
    assert third.observables.rotation.tobytes() == first.observables.rotation.tobytes()
    assert "damaged" in capsys.readouterr().err


def test_a_reference_that_takes_too_long_is_not_tried_again_within_as_many_seconds(monkeypatch):
    # A chunk of steps in quadruple precision takes seconds, more than this test needs.
    monkeypatch.setattr("polhode.solvers.taylor._CHUNK", 10)
    scene, tried = replace(PAPER, time=47.0), []
    honest = module._compute

    def slow(scene, form, problem, samples, deadline):
        tried.append(deadline)
        return honest(scene, form, replace(problem, end=2e4), samples, deadline)

    monkeypatch.setattr(module, "_compute", slow)
    watched, share = "polhode.harness.common.timing.with_processor", 0.0
    monkeypatch.setattr(watched, lambda run: (run(), 1e-2, share))
    with pytest.raises(ReferenceFailedError, match="time_limit"):
        reference(scene, "quaternion", 11, 1e-2)
    # Other work was why: nothing is kept.
    assert len(tried) == 1 + MAX_REPETITIONS
    share = 1e-2
    for seconds in (1e-2, 1e-2, 1e-3):
        with pytest.raises(ReferenceFailedError, match="time_limit") as caught:
            reference(scene, "quaternion", 11, seconds)
        assert caught.value.status == Status.TIME_LIMIT
    assert len(tried) == 2 + MAX_REPETITIONS
    # Kept without a status, by an earlier version, it is tried again.
    key = module._key(find_form("quaternion").problem(scene), 11)
    old = cache.load(key)
    assert old
    assert old.pop("status") == "time_limit"
    cache.save(key, old)
    with pytest.raises(ReferenceFailedError, match="time_limit"):
        reference(scene, "quaternion", 11, 1e-3)
    assert len(tried) == 3 + MAX_REPETITIONS
    monkeypatch.undo()
    assert len(reference(scene, "quaternion", 11, 100.0).times) == 11


def test_every_full_form_has_the_same_reference_and_averaged_ones_their_own():
    assert (
        reference(SPHEROID, "spheroid-axis", 11).form
        == reference(SPHEROID, "euler-angles", 11).form
        == "quaternion"
    )
    assert reference(SPHEROID, "averaged-spheroid", 11).form == "averaged-spheroid"


def test_references_of_a_body_with_renamed_axes_have_its_own_orientation():
    """The averaged equations, and so the problem, are the same to the last bit."""
    start = (
        BodyStart((1, 0, 0, 0), (0.3, 0.2, 0.7)),
        BodyStart((0.5, -0.5, -0.5, -0.5), (0.7, 0.3, 0.2)),
    )
    bodies = Ellipsoid((1.0, 1.0, 2.0)), Ellipsoid((2.0, 1.0, 1.0))
    scenes = [Scene(*each, 100.0) for each in zip(bodies, (1e4, 1e4), start, strict=True)]
    form = find_form("averaged-second-order")
    one, other = (form.problem(scene) for scene in scenes)
    assert (one.start, one.parameters) == (other.start, other.parameters)
    seen, renamed = (reference(scene, form, 5).observables.rotation for scene in scenes)
    np.testing.assert_array_equal(renamed, np.roll(seen, 1, axis=1))


def test_beyond_the_horizon_there_is_no_reference():
    with pytest.raises(
        ReferenceFailedError, match="expected at most 5e\\+07 above St = 1e6"
    ) as caught:
        reference(replace(PAPER, stokes=1e8, time=1e8), "quaternion", 11)
    assert not caught.value.status
