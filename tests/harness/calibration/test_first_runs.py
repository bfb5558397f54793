from pathlib import Path

import pytest
from commandline import Run

from polhode.harness.picking.laws import Laws, load_laws, parse_laws


def test_first_runs_are_measured_alone(tmp_path: Path, here: Run):
    shipped, file = load_laws(), tmp_path / "laws.json"
    kept = {
        method: law
        for method, law in shipped.methods.items()
        if method == ("quaternion", "cyrk-vern8")
    }
    Laws(kept, shipped.source).save(file)
    done = here("calibrate", "--first-runs", "--to", str(file))
    assert (done.returncode, done.stdout) == (0, f"{file}: first runs of 1 methods\n"), done.stderr
    (law,) = parse_laws(file.read_text(encoding="utf-8")).methods.values()
    (before,) = kept.values()
    assert (law.cost, law.errors) == (before.cost, before.errors)
    assert 0.001 < law.compile_seconds < 10


@pytest.mark.parametrize("content", [None, "{}"])
def test_first_runs_need_laws(content: str | None, tmp_path: Path, here: Run):
    file = tmp_path / "laws.json"
    if content:
        file.write_text(content)
    done = here("calibrate", "--first-runs", "--to", str(file))
    assert (done.returncode, done.stdout) == (2, "")
    assert str(file) in done.stderr or "expected" in done.stderr
