"""The hard cases: who gets through, who is wrong, who fails and why."""

from html import escape
from typing import Any

import pandas as pd

from polhode.harness.site.markup import Page, bullets, missing, prose, scroll
from polhode.harness.site.sources import Sources, StudyRecords
from polhode.harness.text import duration, scientific
from polhode.models.scenes import SCENES
from polhode.solvers.catalogue import SOLVERS
from polhode.solvers.contract import Status

STUDY = "hard-cases"
COMMAND = "polhode bench harness/studies/hard_cases.toml"
# A run that reached its end but is further off the exact solution of its own form has no digit to trust.
INACCURATE = 1e-3
LEAD = "Every built-in scene, by every form that accepts it and every solver, at one tolerance."
Block = tuple[str, float, float]
"""Scene, St and tolerance."""
KINDS = ("reached", "inaccurate", "stopped", "failed")
SIGNS = {"reached": "✓", "inaccurate": "≈", "stopped": "◷", "failed": "✕", "absent": "·"}


def hard_page(sources: Sources) -> Page:
    """Form × solver, one block of rows per scene."""
    study = sources.studies.get(STUDY)
    if study is None:
        return Page("hard", "Hard cases", LEAD, missing("The hard cases are", COMMAND))
    body = (
        _summary(study)
        + '<p class="key signs"><span class="reached">✓ reached</span><span class="inaccurate">≈ reached, but off by '
        f'more than {INACCURATE:g}</span><span class="stopped">◷ stopped at the limit of '
        f'{_limit(study)}</span><span class="failed">✕ failed</span><span>· not run: the form or solver does '
        "not take the scene</span></p>" + scroll(_matrix(study)) + _reasons(study)
    )
    return Page("hard", "Hard cases", LEAD, body, (COMMAND,))


def outcome(run: dict[Any, Any]) -> tuple[str, str]:
    """Outcome of a run (reached, inaccurate, stopped, failed), and the reason in words."""
    status = str(run["status"])
    if status != Status.REACHED_END:
        meaning = Status(status).meaning if status in set(Status) else ""
        message = _known(run.get("message"))
        kind = "stopped" if status in (Status.TIME_LIMIT, Status.STEP_LIMIT) else "failed"
        return kind, f"{status.replace('_', ' ')}: {message or meaning}"
    error, seconds = _known(run.get("solver_slow_error")), _known(run.get("seconds"))
    took = f"{duration(seconds)}, " if seconds is not None else ""
    if error is None:
        failure = _known(run.get("reference_failed"))
        return "inaccurate", f"{took}error unknown: {failure or 'no certified reference'}"
    model = _known(run.get("model_slow_error")) or 0.0
    off = f"; the form itself is off by {scientific(model)}" if model > 0 else ""
    text = f"{took}solver error {scientific(error)}{off}"
    return ("reached" if error <= INACCURATE else "inaccurate"), text


def _summary(study: StudyRecords) -> str:
    counts: dict[str, dict[str, int]] = {}
    for run in study.table.to_dict("records"):
        own = counts.setdefault(str(run["solver"]), dict.fromkeys(KINDS, 0))
        own[outcome(run)[0]] += 1
    sums = {kind: sum(own[kind] for own in counts.values()) for kind in KINDS}
    total = {name: sum(own.values()) for name, own in counts.items()}
    best = sorted(counts, key=lambda name: (-counts[name]["reached"] / total[name], name))
    through = [name for name in best if counts[name]["reached"] == total[name]]
    worst = best[-1]
    sentences = [
        f"{sums['reached']} of {sum(total.values())} runs reached the end with a solver error below {INACCURATE:g}; "
        f"{sums['inaccurate']} reached it with a larger one; "
        f"{sums['stopped']} were stopped at the limit of {_limit(study)}; {sums['failed']} failed.",
        f"Through every case they take: {', '.join(through) or 'nobody'}.",
        f"Most often stuck: {worst}, {total[worst] - counts[worst]['reached']} of {total[worst]}.",
    ]
    return bullets(sentences)


def _limit(study: StudyRecords) -> str:
    """The time limit of the runs in words."""
    limits = sorted({float(record["max_seconds"]) for record in study.records if record.get("max_seconds")})
    return " or ".join(duration(limit) for limit in limits) or "time"


def _blocks(study: StudyRecords) -> dict[Block, dict[str, dict[str, tuple[str, str]]]]:
    """Outcomes by scene, form and solver."""
    blocks: dict[Block, dict[str, dict[str, tuple[str, str]]]] = {}
    for run in study.table.to_dict("records"):
        block = str(run["scene_name"]), float(run["stokes"]), float(run["tolerance"])
        blocks.setdefault(block, {}).setdefault(run["form"], {})[run["solver"]] = outcome(run)
    return blocks


def _title(block: Block) -> str:
    scene, stokes, tolerance = block
    return f"<b>{escape(scene)}</b>, St = {stokes:g}, tolerance {tolerance:g}"


def _columns(study: StudyRecords) -> list[str]:
    known, found = list(SOLVERS), set(study.table["solver"])
    return [name for name in known if name in found] + sorted(found - set(known))


def _matrix(study: StudyRecords) -> str:
    solvers = _columns(study)
    head = "".join(f"<th scope=col><span>{escape(name)}</span></th>" for name in solvers)
    rows = []
    for block, forms in _blocks(study).items():
        about = f": {SCENES[block[0]].summary}" if block[0] in SCENES else ""
        title = _title(block) + prose(about)
        rows.append(f'<tr class="scene"><th colspan="{len(solvers) + 1}" scope=colgroup>{title}</th></tr>')
        for form, cells in forms.items():
            own = "".join(_cell(f"{form}, {name}", cells.get(name, ("absent", "not run"))) for name in solvers)
            rows.append(f"<tr><th scope=row>{escape(form)}</th>{own}</tr>")
    return f"<table class=matrix><thead><tr><th>form</th>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table>"


def _cell(method: str, found: tuple[str, str]) -> str:
    kind, reason = found
    text = escape(f"{method}: {reason}")
    return f'<td class="{kind}" title="{text}"><span aria-label="{text}">{SIGNS[kind]}</span></td>'


def _reasons(study: StudyRecords) -> str:
    parts = ["<h2>Reasons</h2>"]
    for block, forms in _blocks(study).items():
        reasons: dict[tuple[str, str, str], list[str]] = {}
        for form, cells in forms.items():
            for solver, (kind, reason) in cells.items():
                if kind != "reached":
                    reasons.setdefault((form, kind, reason), []).append(solver)
        if reasons:
            lines = [f"{form}, {', '.join(names)}: {kind}, {why}" for (form, kind, why), names in reasons.items()]
            parts.append(f"<details><summary>{_title(block)} ({len(lines)})</summary>{bullets(lines)}</details>")
    return "".join(parts)


def _known(value: Any) -> Any:
    return None if value is None or value is pd.NA or value != value else value
