"""Reports of a small study, and the site made of them."""

import json
from pathlib import Path

from commandline import STUDY

from polhode.harness.analysis.frames import frame
from polhode.harness.averaging.data import AveragingErrors
from polhode.harness.common.store import Store, export
from polhode.harness.pages.averaging import write_page
from polhode.harness.pages.regimes import RUN_COLUMNS
from polhode.harness.site.build import build
from polhode.harness.studies.runner import Runner
from polhode.harness.studies.study import parse_study

# A run that took half the time predicted, with a tenth of the error predicted, on a machine three times too slow.
HELD_OUT = """\
scene,form,solver,tolerance,seconds,seconds_at_usual_pace,seconds_predicted,slow_error,slow_error_predicted,slow_error_high
h1,quaternion,taylor,1e-08,0.003,0.001,0.002,1e-08,1e-07,1e-06
"""
# The tag of the hard cases' scenes.
TAG = "hard"
# Model error of the invented case: C / St.
C = 8.0


def small_reports(folder: Path) -> Path:
    """A bench of one scene at two St, one of its runs stopped; hard cases; an accuracy that follows C / St."""
    import tomllib

    with Store(folder / "store.sqlite") as store:
        records = Runner(store, quiet=True).run(parse_study(tomllib.loads(STUDY)))
    stopped = {**records[0], "status": "time_limit", "message": "stopped by hand", "inferred": False}
    for name in ("seconds", "slow_error", "orientation_error"):
        stopped[name] = None
    records = [stopped, *records[1:]]
    for name in ("bench", "hard-cases", "regimes", "pick"):
        (folder / "reports" / name).mkdir(parents=True)
    for name, tags in (("bench", []), ("hard-cases", [TAG])):
        tagged = [{**record, "tags": tags} for record in records]
        export(tagged, folder / "reports" / name / "records.jsonl")
    table = frame(records)
    columns = [column for column in RUN_COLUMNS if column in table]
    table[columns].to_csv(folder / "reports" / "regimes" / "runs.csv", index=False)
    (folder / "reports" / "pick" / "runs.csv").write_text(HELD_OUT, encoding="utf-8")
    rows = [
        AveragingErrors(
            "case",
            "spheroid",
            "averaged-spheroid",
            (1.0, 1.0, 2.0),
            stokes,
            0.5,
            (C / stokes,) * 4,
            (1e-9,) * 4,
            1e-12,
            9,
        )
        for stokes in (1e2, 1e3, 1e4, 1e5, 1e6)
    ]
    write_page(rows, folder / "reports" / "accuracy", "polhode accuracy")
    return folder / "reports"


def site(folder: Path, reports: Path) -> dict[str, str]:
    """Pages by name."""
    build(reports, folder, {})
    return {page.stem: page.read_text(encoding="utf-8") for page in sorted(folder.glob("*.html"))}


def data_of(page: str, key: str):
    """What a page's scripts read under a key."""
    _, _, rest = page.partition(f'<script type="application/json" id="{key}">')
    return json.loads(rest.partition("</script>")[0].replace("<\\/", "</"))
