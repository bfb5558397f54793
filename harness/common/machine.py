"""Which machine and which versions a number came from."""

import os
import platform
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

PACKAGES = ("polhode", "numpy", "scipy", "numba", "heyoka", "scikit-sundae", "cyrk", "pandas", "matplotlib")
ABSENT = "absent"


def machine() -> dict[str, str | int]:
    """Processor, cores, system and Python."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count() or 0,
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
    }


@cache
def package_version(package: str) -> str:
    """Version of an installed package, "absent" if it is not installed."""
    try:
        return version(package)
    except PackageNotFoundError:
        return ABSENT


def versions() -> dict[str, str]:
    """Versions of the packages that a result depends on; missing ones are left out."""
    found = {package: package_version(package) for package in PACKAGES}
    return {package: number for package, number in found.items() if number != ABSENT}


def now() -> str:
    """Date and time in UTC, ISO 8601 to the second."""
    return datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()
