"""Reports of a small study, and the site made of them."""

import json
import tomllib
from pathlib import Path

from commandline import STUDY
from PIL import Image

from polhode.harness.common.store import Store, write_records
from polhode.harness.pages import outcomes, regimes
from polhode.harness.site.build import build
from polhode.harness.studies.runner import Runner
from polhode.harness.studies.study import parse_study

# A page with everything that Markdown pages of reports hold.
OWN = """\
# My `own` &lt;study&gt;

## Lx of 1

Text of 1.7e+02 < I_max, [more](more.md), [data](data.csv) and [docs](../../docs/method.md).

![A picture](drawn.png)

![Nowhere](lost.png)

The particle starts at $t \\approx \\sqrt{\\mathrm{St}}$:

$$\\dot L_z = -\\tfrac12 \\nu L_z$$

| name | *value* |
| ---- | ------: |
| `a`  |  1.0e-9 |
| `b`  |  2.0e-9 |
| `c`  |  3.0e-9 |
| `d`  |  4.0e-9 |
| `e`  |  5.0e-9 |
| `f`  |  6.0e-9 |
| `g`  |  7.0e-9 |
| `h`  |  7.0e-9 |
"""
# The tag of the hard cases' scenes.
TAG = "hard"


def small_reports(folder: Path) -> Path:
    """A bench of one scene at two St, a run stopped; hard cases with their page, a map, a page of its own kind."""
    study = parse_study(tomllib.loads(STUDY))
    with Store(folder / "store.sqlite") as store:
        records = Runner(store, quiet=True).run(study)
    stopped = {
        **records[0],
        "status": "time_limit",
        "message": "stopped by hand",
        "inferred": False,
    }
    for name in ("seconds", "slow_error", "orientation_error"):
        stopped[name] = None
    records = [stopped, *records[1:]]
    reports = folder / "reports"
    (reports / "bench").mkdir(parents=True)
    write_records(records, reports / "bench")
    outcomes.write_page(
        study,
        [{**record, "tags": [TAG]} for record in records],
        reports / "hard-cases",
        "polhode bench x.toml",
    )
    regimes.write_page(study, records, reports / "regimes", "polhode regimes")
    (reports / "own").mkdir()
    (reports / "own" / "README.md").write_text(OWN, encoding="utf-8")
    (reports / "own" / "more.md").write_text(
        "# More\n\n[Back](README.md#lx-of-1)\n", encoding="utf-8"
    )
    Image.new("RGB", (4, 4)).save(reports / "own" / "drawn.png")
    return reports


def site(folder: Path, reports: Path, docs: Path = Path("none")) -> dict[str, str]:
    """Pages by name, as "cost" and "reports/bench/README"; without documentation unless its folder is given."""
    build(reports, folder, {}, docs=docs)
    return pages_of(folder)


def pages_of(folder: Path) -> dict[str, str]:
    """Pages of a site that was built, by name."""
    return {
        page.relative_to(folder).with_suffix("").as_posix(): page.read_text(encoding="utf-8")
        for page in sorted(folder.rglob("*.html"))
    }


def data_of(page: str, key: str):
    """What a page's scripts read from its element of that id, parsed from JSON."""
    _, _, rest = page.partition(f'<script type="application/json" id="{key}">')
    return json.loads(rest.partition("</script>")[0])
