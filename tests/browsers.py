"""Pages opened in Chromium, without a network, which tell what they hold."""

import json
import re
import shutil
import subprocess
from collections.abc import Iterable
from html import unescape
from pathlib import Path
from typing import Any

# The path of a browser; None where there is none.
CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)
# No network, no traces in the user's profile. The browser's own clock runs ahead while nothing happens: up
# to ten minutes of it, in milliseconds, pass in a moment; then the document is printed.
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
# A page that opens those under test one after another, each in a frame, until it has posted a message.
# The messages stand in `data-found` of its body.
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
    """What each page of a folder posts to its parent, parsed: one JSON text for each frame.

    A frame is an address in the folder, and the width and height of its window in pixels. The browser is stopped
    after so many seconds, by estimate far more than it takes: then subprocess.TimeoutExpired is raised.
    """
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
    attribute = re.search(r'data-found="([^"]*)"', done.stdout)
    pages = json.loads(unescape(attribute[1])) if attribute else []
    assert len(pages) == len(frames), done.stderr[-2000:]
    return pages
