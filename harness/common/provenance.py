"""Where and when records were measured, in words."""

from collections.abc import Sequence

from polhode.harness.common.store import Record


def dates(records: Sequence[Record]) -> str:
    """The day, or the first and the last one, on which records were measured; some of them may not tell."""
    days = sorted({record["date"][:10] for record in records if record.get("date")})
    if not days:
        return "on an unknown date"
    span = f"on {days[0]}" if len(days) == 1 else f"from {days[0]} to {days[-1]}"
    return span if all(record.get("date") for record in records) else f"{span}, and on unknown dates"


def header(title: str, command: str, records: Sequence[Record]) -> list[str]:
    """Head of a page: its title, the command that makes it, machines, versions and dates of its records."""
    machines = dict.fromkeys(_machine(record) for record in records)
    return [
        f"# {title}",
        "",
        f"Made by `{command}`. Do not edit: the next run overwrites this page.",
        "",
        f"Measured {dates(records)} on {' and '.join(machines)}.",
        "",
    ]


def _machine(record: Record) -> str:
    """Machine and versions of a record."""
    machine, versions = record["machine"], record["versions"]
    packages = ", ".join(f"{name} {number}" for name, number in versions.items())
    place = f"{machine['processor']}, {machine['cores']} cores, {machine['system']}, Python {machine['python']}"
    return f"{place} ({packages})"
