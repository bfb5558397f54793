"""The hard cases: who gets through, who is wrong, who fails and why."""

from html import escape

from polhode.harness.analysis.outcomes import (
    BEYOND,
    SIGNS,
    Block,
    Outcome,
    about,
    blocks,
    columns,
    limit,
    limits,
    reasons,
    sentences,
    title,
)
from polhode.harness.site.markup import Page, bullets, missing, prose, scroll
from polhode.harness.site.origins import commands, origins
from polhode.harness.site.sources import Sources

STUDY = "hard-cases"
COMMAND = "polhode bench harness/studies/hard_cases.toml"
LEAD = "Every built-in scene, by every form that accepts it and every solver, at a usual and at a tight tolerance."


def hard_page(sources: Sources) -> Page:
    """Form × solver, one block of rows per scene."""
    study = sources.studies.get(STUDY)
    if study is None:
        return Page("hard", "Hard cases", LEAD, missing("The hard cases are", COMMAND))
    allowed = limits(study.records)
    found = blocks(study.table, allowed)
    body = (
        bullets(sentences(study.table, allowed))
        + '<p class="key signs"><span class="reached">✓ reached</span><span class="inaccurate">≈ reached, but '
        f'{prose(BEYOND)}</span><span class="unknown">? reached, no reference tells the error</span>'
        f'<span class="stopped">◷ stopped at the limit of {limit(study.table)}</span>'
        '<span class="failed">✕ failed</span><span>· not run: the form or solver does not take the scene</span></p>'
        + scroll(_matrix(found, columns(study.table)), tall=True)
        + "<h2>Reasons</h2>"
        + "".join(_reasons(block, reasons(forms)) for block, forms in found.items())
    )
    return Page("hard", "Hard cases", LEAD, body, commands(sources.folder, [study]), origins(sources.folder, [study]))


def _matrix(found: dict[Block, dict[str, dict[str, Outcome]]], solvers: list[str]) -> str:
    head = "".join(f"<th scope=col><span>{escape(name)}</span></th>" for name in solvers)
    rows = []
    for block, forms in found.items():
        summary = f": {about(block)}" if about(block) else ""
        heading = f"<span><b>{prose(title(block))}</b>{prose(summary)}</span>"
        rows.append(f'<tr class="scene"><th colspan="{len(solvers) + 1}" scope=colgroup>{heading}</th></tr>')
        for form, cells in forms.items():
            own = "".join(_cell(f"{form}, {name}", cells.get(name, ("absent", "not run"))) for name in solvers)
            rows.append(f"<tr><th scope=row>{escape(form)}</th>{own}</tr>")
    return f"<table class=matrix><thead><tr><th>form</th>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table>"


def _cell(method: str, found: Outcome) -> str:
    kind, reason = found
    text = escape(f"{method}: {reason}")
    return f'<td class="{kind}" title="{text}"><span aria-label="{text}">{SIGNS[kind]}</span></td>'


def _reasons(block: Block, lines: list[str]) -> str:
    if not lines:
        return ""
    return f"<details><summary>{prose(title(block))} ({len(lines)})</summary>{bullets(lines)}</details>"
