"""Build the site: Sphinx makes it of the Markdown pages of docs and reports, and of the interactive pages."""

import re
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from sphinx.application import Sphinx
from sphinx.util.console import nocolor
from sphinx.util.docutils import docutils_namespace, patch_docutils

from polhode.harness.common.files import write_file
from polhode.harness.site.sources import write_sources
from polhode.models.scene import Scene

_HERE = Path(__file__).resolve().parent
# A clone has its documentation beside the harness; an installation has none.
DOCS = _HERE.parents[1] / "docs"
# Sphinx's configuration.
_CONFIG: dict[str, Any] = {
    "project": "polhode",
    "html_title": "polhode",
    "extensions": [
        "myst_parser",
        "sphinx.ext.autodoc",
        "sphinx.ext.napoleon",
        "polhode.harness.site.extension",
    ],
    "myst_enable_extensions": ["attrs_block", "dollarmath"],
    # Headings of levels 1 to 4 can be linked to: pages have no others.
    "myst_heading_anchors": 4,
    # Docstrings are read as Markdown is: `code`.
    "default_role": "code",
    "autodoc_member_order": "bysource",
    # The docstrings tell types.
    "autodoc_typehints": "none",
    "autodoc_preserve_defaults": True,
    "napoleon_google_docstring": False,
    # Dashes alone.
    "smartquotes_action": "D",
    "html_theme": "furo",
    "html_theme_options": {"top_of_page_buttons": []},
    "templates_path": [str(_HERE / "templates")],
    "html_static_path": [str(path) for path in sorted(_HERE.glob("*.[cj]s*"))],
    "html_css_files": ["theme.css", "site.css"],
    "html_js_files": ["tables.js"],
    # `extension.py` defines both.
    "html_math_renderer": "mathml",
    "html_search_language": "prose",
    "html_copy_source": False,
    "html_show_sourcelink": False,
    # Summaries of results need a server.
    "html_show_search_summary": False,
    "html_show_copyright": False,
    "html_use_index": False,
    "html_domain_indices": False,
}
# Two regions of the theme's pages have no name by which a screen reader tells them apart.
_LABELS = {"sidebar-drawer": "Pages", "toc-drawer": "On this page"}
# Patterns of markup that no style or script of the site asks for, and what takes its place. Every word, cell
# and link has some: pages become smaller.
_SHORTER = {
    r'<span class="pre">([^<]*)</span>': r"\1",
    r"(<t[dh][^>]*>)<p>([^\n]*?)</p>\n?(?=</t[dh]>)": r"\1\2",
    # A header must say something.
    r'<th class="head[\w -]*"></th>': "<td></td>",
    r'<tr class="row-(?:even|odd)">': "<tr>",
    r'<span class="(?:std std-\w+|xref[\w -]*)">([^<]*)</span>': r"\1",
    r'class="docutils literal notranslate"': 'class="literal"',
    r'class="((?:current )?reference) internal"': r'class="\1"',
}
# Names, blanks and brackets of code, Pygments' classes, which have the colour of the text around them.
_UNCOLOURED = re.compile(r'<span class="(?:n|nx|p|w)">([^<]*)</span>')
# Files of Sphinx and of its theme that no page loads.
_UNUSED = (
    "*.map",
    "*.png",
    "*.txt",
    ".buildinfo",
    "objects.inv",
    "basic.css",
    "debug.css",
    "skeleton.css",
    "*-stemmer.js",
    "furo-extensions.js",
)


def build(
    reports: Path,
    out: Path,
    scenes: dict[str, Scene],
    say: Callable[[str], None] = lambda _: None,
    docs: Path | None = None,
) -> Path:
    """Write the site and return its opening page.

    Parameters
    ----------
    reports
        Folder of the reports.
    out
        Folder of the site. Each file is replaced at once, when all are made.
    scenes
        Scenes of the user by name, whose motions are shown too.
    say
        Receives a line for each page.
    docs
        Folder of the documentation, by default polhode's own; where there is none, the site has the
        reports alone.
    """
    # Its warnings go to where colours may not be shown.
    nocolor()
    with TemporaryDirectory() as folder:
        sources = Path(folder) / "sources"
        pages = Path(folder) / "pages"
        write_sources(reports, docs or DOCS, scenes, sources, say)
        # The block undoes what Sphinx registers: a process may build several sites.
        with patch_docutils(), docutils_namespace(), warnings.catch_warnings():
            # Sphinx's own extensions call what a later Sphinx will not have.
            warnings.simplefilter("ignore", DeprecationWarning)
            warnings.simplefilter("ignore", PendingDeprecationWarning)
            app = Sphinx(
                sources,
                None,
                pages,
                Path(folder) / "doctrees",
                "html",
                _CONFIG,
                status=None,
                warning=sys.stderr,
            )
            app.connect("html-page-context", lambda _, name, *__: say(name))
            app.build()
        for path in sorted(pages.rglob("*")):
            if path.is_file() and not any(path.match(pattern) for pattern in _UNUSED):
                page = path.read_text("utf-8") if path.suffix == ".html" else None
                content = _finished(page) if page else path.read_bytes()
                write_file(out / path.relative_to(pages), content)
    return out / "index.html"


def _finished(page: str) -> str:
    """The page with its regions named, and smaller: without indents, and without what no style asks for."""
    for region, label in _LABELS.items():
        page = page.replace(
            f'<aside class="{region}', f'<aside aria-label="{label}" class="{region}'
        )
    for markup, shorter in _SHORTER.items():
        page = re.sub(markup, shorter, page)
    # Parts are by turns text, and code or data: the latter keep their indents.
    parts = re.split(r"(<(?:pre|script)\b.*?</(?:pre|script)>)", page, flags=re.DOTALL)
    parts[::2] = [re.sub(r"\s*\n\s*", "\n", part) for part in parts[::2]]
    parts[1::2] = [_UNCOLOURED.sub(r"\1", part) for part in parts[1::2]]
    return "".join(parts)
