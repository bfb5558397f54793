"""The rooms lie beside each other in the repository and under `polhode` where it is installed."""

import gzip
import os
import tarfile
from pathlib import Path
from typing import Any

from setuptools import find_packages, setup
from setuptools.command.sdist import sdist


class ReproducibleSource(sdist):
    """A source distribution of the same bytes from the same files, where SOURCE_DATE_EPOCH gives their date."""

    def make_archive(self, base_name: str, kind: str, **how: Any) -> str:
        """Write the archive: names in order, one date, no owner, and modes without the umask."""
        date = os.environ.get("SOURCE_DATE_EPOCH")
        if date is None or kind != "gztar":
            return super().make_archive(base_name, kind, **how)

        def plain(member: tarfile.TarInfo) -> tarfile.TarInfo:
            member.mtime = int(date)
            member.uid = member.gid = 0
            member.uname = member.gname = ""
            member.mode = 0o755 if member.isdir() or member.mode & 0o100 else 0o644
            return member

        target = Path(f"{base_name}.tar.gz")
        target.parent.mkdir(parents=True, exist_ok=True)
        with (
            target.open("wb") as file,
            gzip.GzipFile("", "wb", mtime=int(date), fileobj=file) as packed,
            tarfile.open(fileobj=packed, mode="w", format=tarfile.PAX_FORMAT) as archive,
        ):
            # Folders are walked in order.
            archive.add(how["base_dir"], filter=plain)
        return str(target)


# Modes in the wheel are those of copies that are made here.
os.umask(0o022)
rooms = ("models", "solvers", "harness")
found = find_packages(include=[pattern for room in rooms for pattern in (room, f"{room}.*")])
setup(
    packages=["polhode", *(f"polhode.{name}" for name in found)],
    cmdclass={"sdist": ReproducibleSource},
)
