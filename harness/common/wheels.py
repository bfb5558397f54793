"""Platforms for which libraries of solvers have wheels; elsewhere pip compiles them, and polhode requires none."""

import platform

# Package → systems and processors, by Python's names; `pyproject.toml` requires it there.
PLATFORMS = {
    "cyrk": (("Linux", "x86_64"), ("Darwin", "arm64"), ("Windows", "AMD64")),
    "heyoka": (("Linux", "x86_64"), ("Linux", "aarch64")),
    "scikit-sundae": (
        ("Linux", "x86_64"),
        ("Darwin", "arm64"),
        ("Darwin", "x86_64"),
        ("Windows", "AMD64"),
    ),
}


def why_missing(why_not: str | None, package: str) -> str | None:
    """Why a solver cannot run, and where its library has no wheel for this platform, that pip compiles it."""
    here = platform.system(), platform.machine()
    if why_not is None or here in PLATFORMS.get(package, (here,)):
        return why_not
    return f"{why_not} (no wheel for {' '.join(here)}: pip compiles it)"
