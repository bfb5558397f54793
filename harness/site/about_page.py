"""Which machine, which versions, which files: where every number comes from."""

from typing import Any

from polhode.harness.machine import machine, versions
from polhode.harness.site.markup import Page, bullets, missing, table
from polhode.harness.site.sources import Sources, StudyRecords, measured

LEAD = "Times belong to the machine they were measured on; errors and counts carry over to others."


def about_page(sources: Sources) -> Page:
    """Machine and versions of every study, and of this page."""
    rows = [_row(study) for study in sources.studies.values()]
    header = ["study", "runs", "scenes", "machine", "versions", "measured", "sentinel"]
    parts = ["<h2>Studies</h2>", table(header, rows, (1, 2)) if rows else missing("Measured runs are", "polhode bench")]
    if sources.unreadable:
        parts += ["<h2>Files that could not be read</h2>", bullets(sources.unreadable)]
    parts += [
        "<h2>This site</h2>",
        table(["", ""], [[name, str(value)] for name, value in {**machine(), **versions()}.items()]),
        "<p>Data beside the pages in Markdown: every folder of <code>reports/</code> holds its own "
        "<code>README.md</code>, and the runs as <code>records.jsonl</code>. How errors, references and times are "
        "measured stands in <code>docs/method.md</code>.</p>",
    ]
    return Page("about", "Where the numbers come from", LEAD, "".join(parts), ("polhode report", "polhode doctor"))


def _row(study: StudyRecords) -> list[str]:
    machines = {_machine(record["machine"]) for record in study.records if isinstance(record.get("machine"), dict)}
    packages = {_versions(record["versions"]) for record in study.records if isinstance(record.get("versions"), dict)}
    sentinels = [record["sentinel_seconds"] for record in study.records if record.get("sentinel_seconds")]
    spread = f"{min(sentinels) * 1e6:.0f} to {max(sentinels) * 1e6:.0f} µs" if sentinels else "–"
    scenes = study.groups()
    when = measured([study]) or "–"
    elsewhere = f"see reports/{study.name.partition('/')[0]}/README.md"
    return [
        study.name,
        str(len(study.records)),
        str(len(scenes)),
        _all(machines) or elsewhere,
        _all(packages) or elsewhere,
        when,
        spread,
    ]


def _all(texts: set[str]) -> str:
    return "; ".join(sorted(texts))


def _machine(content: dict[str, Any]) -> str:
    names = ("processor", "cores", "system", "python")
    processor, cores, system, python = (content.get(name, "?") for name in names)
    return f"{processor}, {cores} cores, {system}, Python {python}"


def _versions(content: dict[str, Any]) -> str:
    return ", ".join(f"{name} {number}" for name, number in content.items())
