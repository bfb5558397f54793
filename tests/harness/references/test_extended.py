"""References of long runs, by two methods in double precision, against those in extended precision."""

from time import perf_counter

import pytest

from polhode.harness.references import reference as module
from polhode.harness.references.errors import errors
from polhode.harness.references.reference import ReferenceFailedError, reference
from polhode.models.catalogue import reference_form
from polhode.models.scenes import named_scene
from polhode.solvers.solve import solve

pytestmark = pytest.mark.usefixtures("quickly_compiled")


@pytest.fixture(scope="module", params=["paper", "spheroid"])
def known(request, tmp_path_factory):
    """A scene with its reference in extended precision, kept in a cache of its own."""
    scene = named_scene(request.param)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("POLHODE_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield scene, reference(scene, reference_form(scene), 51)


def test_two_methods_know_a_run_as_well_as_they_say(known, monkeypatch):
    scene, exact = known
    monkeypatch.setattr(module, "EXTENDED_UP_TO_ROTATIONS", 10.0)
    found = reference(scene, reference_form(scene), 51, seconds=60.0)
    assert (found.precision, found.certificate.solver) == ("double", "cyrk-vern8")
    apart = errors(scene.ellipsoid, found.observables, exact.observables)
    assert 0 < apart.slow <= found.slow_uncertainty + exact.slow_uncertainty < 1e-11
    assert apart.orientation <= found.orientation_uncertainty + exact.orientation_uncertainty
    # Without a limit of time it is the extended one, as kept.
    assert reference(scene, reference_form(scene), 51).precision != "double"


def test_beyond_so_many_rotations_there_is_none_in_limited_time(monkeypatch):
    monkeypatch.setattr(module, "MOST_ROTATIONS", 30.0)
    with pytest.raises(ReferenceFailedError, match="more than 30 rotations"):
        reference(named_scene("paper"), "quaternion", 51, seconds=1.0)


def test_methods_that_disagree_are_no_reference_and_share_a_limit(monkeypatch):
    runs = []
    monkeypatch.setattr(
        module, "solve", lambda *args, **kw: runs.append((kw, solve(*args, **kw))) or runs[-1][1]
    )
    monkeypatch.setattr(module, "AGAINST", ("cyrk-tsit5", 1e-3))
    monkeypatch.setattr(module, "APART", 1e-6)
    with pytest.raises(ReferenceFailedError, match="two methods are"):
        module._compared(named_scene("paper"), 51, perf_counter() + 10.0)
    (first, found), (second, _) = runs
    assert second["max_seconds"] <= first["max_seconds"] - found.seconds < 10


def test_over_very_many_shear_times_a_third_run_says_how_well_a_reference_is_known(
    known, monkeypatch, tmp_path
):
    scene, exact = known
    # The fixture's cache may hold a run of two methods alone.
    monkeypatch.setenv("POLHODE_CACHE", str(tmp_path))
    monkeypatch.setattr(module, "EXTENDED_UP_TO_STOKES", 1.0)
    monkeypatch.setattr(module, "EXTENDED_TIME", 1.0)
    far = reference(scene, reference_form(scene), 51)
    assert far.precision == "double"
    apart = errors(scene.ellipsoid, far.observables, exact.observables)
    assert 0 < apart.slow <= far.slow_uncertainty + exact.slow_uncertainty < 1e-12
    assert 0 < apart.orientation <= far.orientation_uncertainty + exact.orientation_uncertainty
    monkeypatch.setattr(module, "AGAINST", ("cyrk-tsit5", 1e-3))
    monkeypatch.setattr(module, "APART", 1e-6)
    with pytest.raises(ReferenceFailedError, match="two methods are"):
        reference(scene, reference_form(scene), 52)
