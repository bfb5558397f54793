"""Which machine, which versions, which files: where every number comes from."""

from polhode.harness.common.machine import machine, versions
from polhode.harness.site.markup import Page, bullets, missing, table
from polhode.harness.site.origins import machines, packages
from polhode.harness.site.sources import Sources, StudyRecords, measured

LEAD = "Times belong to the machine they were measured on; errors and counts carry over to others."
SENTINEL = (
    "Scenes counts each St of a scene. Sentinel: the time of a fixed piece of arithmetic, before every batch of runs; "
    "where it varies, the machine did not keep its pace."
)
HEADER = ["study", "runs", "scenes", "machine", "versions", "measured", "sentinel"]


def about_page(sources: Sources) -> Page:
    """Machine and versions of every study, and of this page."""
    rows = [_row(study) for study in sources.studies.values()]
    parts = ["<h2>Studies</h2>"]
    parts += [table(HEADER, rows, (1, 2)), f"<p class=note>{SENTINEL}</p>"] if rows else []
    parts += [] if rows else [missing("Measured runs are", "polhode bench")]
    if sources.unreadable:
        parts += ["<h2>Files that could not be read</h2>", bullets(sources.unreadable)]
    parts += [
        "<h2>This site</h2>",
        table(["built with", ""], [[name, str(value)] for name, value in {**machine(), **versions()}.items()]),
        "<p>Data beside the pages in Markdown: every folder of <code>reports/</code> holds its own "
        "<code>README.md</code>, and beside it the numbers as <code>.jsonl</code>, <code>.csv</code> or "
        "<code>.json</code> files. How errors, references and times are "
        "measured stands in <code>docs/method.md</code>.</p>",
    ]
    return Page("about", "Where the numbers come from", LEAD, "".join(parts), ("polhode report", "polhode doctor"))


def _row(study: StudyRecords) -> list[str]:
    sentinels = [record["sentinel_seconds"] for record in study.records if record.get("sentinel_seconds")]
    spread = f"{min(sentinels) * 1e6:.0f} to {max(sentinels) * 1e6:.0f} µs" if sentinels else "–"
    elsewhere = f"see reports/{study.name.partition('/')[0]}/README.md"
    return [
        study.name,
        str(len(study.records)),
        str(len(study.groups())),
        machines(study) or elsewhere,
        packages(study) or elsewhere,
        measured([study]) or "not told",
        spread,
    ]
