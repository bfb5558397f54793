"""The site by axe: no violation at two widths in both themes, and nothing wider than the screen.

`npm install --no-save axe-core` in the clone brings axe, or the variable AXE_CORE names its file.
"""

import os
import shutil
from pathlib import Path

import pytest
from browsers import CHROMIUM, told
from sites import site

from polhode.harness.site.build import DOCS

ROOT = Path(__file__).parents[3]
AXE = Path(os.environ.get("AXE_CORE", ROOT / "node_modules" / "axe-core" / "axe.min.js"))
WIDTHS = (838, 390)
# Pages of the small site, one of each kind.
KINDS = ("index", "cost", "motion", "search", "reports/own/README", "reports/hard-cases/README")
# Axe judges the page, then its colours alone in the other theme.
JUDGE = """
addEventListener("load", async () => {
  const wrong = [];
  const judge = async (theme, options) => {
    document.body.dataset.theme = theme;
    const result = await axe.run(document, { resultTypes: ["violations"], ...options });
    for (const { id, nodes } of result.violations)
      wrong.push(...nodes.map((node) => [theme, id, node.target.join(" ")].join(": ")));
  };
  await judge("light", {});
  await judge("dark", { runOnly: ["color-contrast", "link-in-text-block"] });
  if (document.documentElement.scrollWidth > innerWidth + 1) wrong.push("scrolls sideways");
  parent.postMessage(JSON.stringify({ name: location.pathname, width: innerWidth, wrong }), "*");
});
"""

pytestmark = [
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium: apt-get install chromium"),
    pytest.mark.skipif(not AXE.is_file(), reason="no axe: npm install --no-save axe-core"),
]


def violations(pages: Path, folder: Path, names: list[str], seconds: float) -> list[str]:
    """What axe finds on the pages of those names, in a copy of the site."""
    copy = folder / "site"
    shutil.copytree(pages, copy)
    for file in copy.rglob("*.html"):
        page = file.read_text(encoding="utf-8")
        scripts = f'<script src="{AXE.resolve().as_uri()}"></script><script>{JUDGE}</script>'
        file.write_text(page.replace("</body>", f"{scripts}</body>"), encoding="utf-8")
    frames = [(f"{name}.html", width, 1000) for name in names for width in WIDTHS]
    found = []
    for page in told(copy, frames, seconds):
        name = page["name"].partition("/site/")[2]
        found += [f"{name} at {page['width']}: {text}" for text in page["wrong"]]
    return found


def test_pages_of_each_kind(site_folder: Path, tmp_path: Path):
    assert violations(site_folder, tmp_path, [*KINDS], seconds=300) == []


@pytest.mark.slow
@pytest.mark.skipif(not DOCS.is_dir(), reason="no committed pages here")
def test_every_page_of_docs_and_reports(tmp_path: Path):
    pages = tmp_path / "whole"
    site(pages, ROOT / "reports", DOCS)
    names = [
        path.relative_to(pages).with_suffix("").as_posix() for path in sorted(pages.rglob("*.html"))
    ]
    assert violations(pages, tmp_path, names, seconds=1800) == []
