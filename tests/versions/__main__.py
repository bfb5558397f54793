"""The tests under each Python that is found, other platforms, and each extra: `python -m versions`, in `tests`.

- `python -m versions [3.12 …] [oldest] [newest] [-- ARGUMENTS OF PYTEST]`: other platforms, then
  the tests under each Python, with the oldest and the newest versions; names leave out the others.
  What comes after `--` selects tests.
- `python -m versions platforms`: what would be installed on other platforms, as resolved by uv.
- `python -m versions aarch64`: forms, solvers and calls on ARM, under emulation.
- `python -m versions extras [3.11 …]`: the wheel with no extra and with each one alone.

Versions are resolved by uv from wheels alone, and written beside this file; what ran is written into
`results.json` and `docs/versions.md`. Exit code 1 if a job finds anything wrong, such as tests that
fail; a Python that is not there is nothing wrong. Exit code 2 if a word is unknown.
"""

import json
import sys
import time
from collections.abc import Callable

from versions import emulated, extras, platforms, pythons
from versions.page import PAGE, page
from versions.tools import PYTHONS, RESULTS, Found

JOBS = ("platforms", "aarch64", "extras")


def note(name: str, run: Callable[[], Found]) -> bool:
    """Run a job, write what it found, and say whether nothing is wrong."""
    began = time.monotonic()
    found = run()
    results = json.loads(RESULTS.read_text(encoding="utf-8")) if RESULTS.is_file() else {}
    results[name] = found
    RESULTS.write_text(json.dumps(results, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    PAGE.write_text(page(results), encoding="utf-8")
    words = found.get("why") or found.get("tests") or "done"
    print(f"{name}: {words}, {time.monotonic() - began:.0f} s", flush=True)
    if "tests" in found:
        return pythons.passed(found) or found["tests"] == pythons.MISSING
    return "why" not in found


def main() -> int:
    """Run what is asked for, and write the page; returns the exit code."""
    words = sys.argv[1:]
    selection: list[str] = []
    if "--" in words:
        selection = words[words.index("--") + 1 :]
        words = words[: words.index("--")]
    unknown = set(words) - {*JOBS, *PYTHONS, *pythons.ENDS}
    if unknown:
        expected = ", ".join((*JOBS, *PYTHONS, *pythons.ENDS))
        print(f"versions: got {', '.join(sorted(unknown))}, expected some of {expected}")
        return 2
    jobs = [name for name in JOBS if name in words]
    versions = [name for name in PYTHONS if name in words]
    ends = [name for name in pythons.ENDS if name in words] or [*pythons.ENDS]
    well = True
    if "platforms" in jobs or not jobs:
        for platform in platforms.PLATFORMS:
            well &= note(platform, lambda platform=platform: platforms.on_platform(platform))
    if "aarch64" in jobs:
        well &= note("aarch64", emulated.run)
    if "extras" in jobs:
        built = extras.wheel()
        for version in versions or extras.USUAL:
            for extra in extras.STEPS:
                job = f"{version} extra {extra}"
                well &= note(job, lambda v=version, e=extra: extras.one(v, e, built))
    if not jobs:
        for version in versions or PYTHONS:
            for end in ends:
                job = f"{version} {end}"
                well &= note(job, lambda v=version, e=end: pythons.one(v, e, selection))
    return int(not well)


if __name__ == "__main__":
    sys.exit(main())
