"""Pages opened in Chromium, without a network, which tell what they hold."""

import json
import re
import shutil
import subprocess
from collections.abc import Iterable
from html import unescape
from pathlib import Path
from typing import Any

CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)
_FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--host-resolver-rules=MAP * ~NOTFOUND",
    "--virtual-time-budget=600000",
    "--dump-dom",
)
# Opens the pages one after another, each in a frame, until it has told.
_HOST = """<!doctype html><body><script>
const pages = %s, found = [];
const next = () => {
  document.querySelector("iframe")?.remove();
  document.body.dataset.found = JSON.stringify(found);
  if (found.length === pages.length) return;
  const [src, width, height] = pages[found.length];
  const frame = Object.assign(document.createElement("iframe"), { src });
  frame.style = `width:${width}px;height:${height}px`;
  document.body.append(frame);
};
addEventListener("message", (e) => { found.push(JSON.parse(e.data)); next(); });
next();
</script></body>"""


def told(folder: Path, frames: Iterable[tuple[str, int, int]], seconds: float = 120) -> list[Any]:
    """What each page of a folder posts to its parent: one JSON text for each address, width and height."""
    frames = [*frames]
    (folder / "host.html").write_text(_HOST % json.dumps(frames), encoding="utf-8")
    command = [str(CHROMIUM), *_FLAGS, f"--user-data-dir={folder}-profile"]
    done = subprocess.run(
        [*command, f"file://{folder}/host.html"],
        capture_output=True,
        text=True,
        timeout=seconds,
        check=True,
    )
    found = re.search(r'data-found="([^"]*)"', done.stdout)
    pages = json.loads(unescape(found[1])) if found else []
    assert len(pages) == len(frames), done.stderr[-2000:]
    return pages
