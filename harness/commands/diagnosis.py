"""What the machine offers: versions, libraries, caches, and whether it is steady enough to time anything."""

import os
from dataclasses import dataclass
from importlib.metadata import version as installed_version
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any

from polhode.harness.common.machine import machine, versions
from polhode.harness.common.timing import sentinel
from polhode.harness.picking.laws import OtherSchemaError, own_laws_path, parse_laws
from polhode.solvers.catalogue import SOLVERS
from polhode.solvers.catalogue import solver as find_solver
from polhode.solvers.compile import cache_folder

# Seconds over which the sentinel is watched.
WATCH = 1.0
# Its median may exceed its minimum by this factor on a machine fit for timing.
STEADY = 1.05
# Busy processes per core beyond which runs share their core.
BUSY = 0.5


@dataclass(frozen=True)
class Cache:
    """A folder in which work is kept between runs.

    Parameters
    ----------
    name : str
    folder : Path
    files, size : int
        What lies there; bytes.
    writable : bool
        Whether more can be kept.
    """

    name: str
    folder: Path
    files: int
    size: int
    writable: bool


@dataclass(frozen=True)
class Steadiness:
    """How a fixed piece of arithmetic fared, repeated for a second.

    Parameters
    ----------
    seconds : float
        Its minimum.
    ratio : float
        Median over minimum: 1 on a steady machine.
    load : float or None
        Processes that wait for a core, per core, over the last minute; None where the system does not tell.
    """

    seconds: float
    ratio: float
    load: float | None

    @property
    def steady(self) -> bool:
        """Whether times measured now mean something."""
        return self.ratio <= STEADY and (self.load is None or self.load <= BUSY)


@dataclass(frozen=True)
class Diagnosis:
    """All that `polhode doctor` tells.

    Parameters
    ----------
    machine : dict
    versions : dict
        Of the packages that a result depends on.
    adapters : tuple of dict
        Per solver: name, package, version, available, why_not.
    caches : tuple of Cache
    laws : str
        Whose cost laws `pick` uses.
    steadiness : Steadiness
    """

    machine: dict[str, Any]
    versions: dict[str, str]
    adapters: tuple[dict[str, Any], ...]
    caches: tuple[Cache, ...]
    laws: str
    steadiness: Steadiness

    @property
    def advice(self) -> list[str]:
        """What to do next, one line each; empty if all is well."""
        lines = [f"{row['name']}: {row['why_not']}" for row in self.adapters if not row["available"]]
        lines += [
            f"{cache.folder}: cannot be written, so that {cache.name} are made anew every time: "
            "set POLHODE_CACHE to a folder of yours"
            for cache in self.caches
            if not cache.writable
        ]
        if not self.steadiness.steady:
            lines.append("times measured now are noisy: stop other work, then look again (errors and counts are fine)")
        return lines


def examine(watch: float = WATCH) -> Diagnosis:
    """Look at everything; takes a little longer than `watch` seconds."""
    return Diagnosis(
        machine=machine(),
        versions=versions(),
        adapters=tuple(_adapter(name) for name in SOLVERS),
        caches=(
            look("references", cache_folder() / "references"),
            look("compiled integrators", cache_folder("heyoka")),
        ),
        laws=_laws(),
        steadiness=watch_sentinel(watch),
    )


def _laws() -> str:
    """Whose cost laws `pick` uses: laws of another version are passed over, unreadable ones are named."""
    own = own_laws_path()
    if not own.is_file():
        return "those of the package"
    try:
        source = parse_laws(own.read_text(encoding="utf-8")).source
    except OtherSchemaError:
        return f"those of the package; passed over, since of another version: {own}"
    except (OSError, ValueError, KeyError, TypeError) as error:
        return f"cannot be read ({error}), remove them to use those of the package: {own}"
    if "refitted" in source:
        return f"times rescaled by {source['refitted']} runs of this machine: {own}"
    return f"fitted on this machine: {own}"


def _adapter(name: str) -> dict[str, Any]:
    method = find_solver(name)
    version = installed_version(method.package) if method.available else None
    return {
        "name": name,
        "package": method.package,
        "version": version,
        "available": method.available,
        "why_not": method.why_not,
    }


def look(name: str, folder: Path) -> Cache:
    """What a cache holds; a folder that does not exist yet counts as writable if it could be made."""
    sizes = [path.stat().st_size for path in folder.rglob("*") if path.is_file()]
    above = next((path for path in (folder, *folder.parents) if path.exists()), Path("/"))
    return Cache(name, folder, len(sizes), sum(sizes), above.is_dir() and os.access(above, os.W_OK))


def watch_sentinel(seconds: float) -> Steadiness:
    """Repeat the sentinel for some seconds."""
    times, until = [sentinel()], perf_counter() + seconds
    while perf_counter() < until:
        times.append(sentinel())
    try:
        load = os.getloadavg()[0] / (os.cpu_count() or 1)
    except OSError:
        load = None
    return Steadiness(min(times), median(times) / min(times), load)
