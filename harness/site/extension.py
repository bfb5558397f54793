"""The site's extension of Sphinx: formulas as MathML, notation, links, a search without numbers.

Sphinx calls `setup`, which registers all that follows. Handlers take what Sphinx passes on with an
event, and name what they use of it. A handler of "doctree-read" gets a page's parsed document and
changes it in place; one of "html-page-context" gets what the template of a page is filled with.
"""

import re
from html import escape, unescape
from typing import Any

from bs4 import BeautifulSoup
from docutils import nodes
from latex2mathml.converter import convert
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.search.en import SearchEnglish

from polhode.harness.site.markup import notation

# Elements of docutils whose text stays as it is: no notation is set in code, formulas and HTML.
_LITERAL = (nodes.FixedTextElement, nodes.literal, nodes.math, nodes.raw, nodes.comment)
# Elements of docutils for the HTML tags that `notation` writes. The style sheet keeps an element of
# class n in one line, which is for numbers.
_INLINE = {"sub": nodes.subscript, "sup": nodes.superscript, "span class=n": nodes.inline}


class ProseSearch(SearchEnglish):
    """Search of English without the numbers of tables, which would be most of the index."""

    # By this name `html_search_language` of the site's configuration chooses the search.
    lang = "prose"
    language_name = "English"

    def word_filter(self, word: str) -> bool:
        """Whether the index holds the word: Sphinx's rule, and no word that begins with a digit or a point."""
        return super().word_filter(word) and not re.match(r"[\d.]", word)


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the renderers of formulas, the search and the handlers with Sphinx."""
    # A renderer is a pair of functions, called at the beginning of an element and at its end. The first
    # one writes the whole formula.
    app.add_html_math_renderer("mathml", (_formula, None), (_displayed, None))
    app.add_search_language(ProseSearch)
    app.connect("doctree-read", _set_notation)
    app.connect("doctree-read", _drop_links_outside)
    # Handlers run in the order of their priorities, 500 unless told. With any larger one this handler runs
    # after the theme's, which makes the navigation.
    app.connect("html-page-context", _shorten_navigation, priority=900)
    # Nothing is kept between pages, so that Sphinx may read and write several at once.
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _formula(writer: Any, node: nodes.math) -> None:
    """Write a formula within a line as MathML; `SkipNode` keeps its LaTeX out."""
    writer.body.append(convert(node.astext()))
    raise nodes.SkipNode


def _displayed(writer: Any, node: nodes.math_block) -> None:
    """Write a formula in a line of its own as MathML; `SkipNode` keeps its LaTeX out."""
    writer.body.append(f'<div class="math">{convert(node.astext(), display="block")}</div>')
    raise nodes.SkipNode


def _set_notation(_: Sphinx, document: nodes.document) -> None:
    """Set plain text as `notation` does: with subscripts, powers and numbers in one line."""
    for text in list(document.findall(nodes.Text)):
        parent = text.parent
        # Code may hold its text in elements of its own.
        if isinstance(parent, _LITERAL) or isinstance(parent.parent, nodes.literal):
            continue
        # A column of numbers is as wide as its numbers, which need no mark to stay in one line.
        if isinstance(parent.parent, nodes.entry) and "text-right" in parent.parent["classes"]:
            continue
        parts = re.split(
            r"<(sub|sup|span class=n)>(.*?)</\w+>", notation(escape(text.astext(), quote=False))
        )
        if len(parts) == 1:
            continue
        # `parts` are the text before the first tag, then by turns a tag, the text in it, and the
        # text after it.
        pieces: list[nodes.Node] = [nodes.Text(unescape(parts[0]))]
        for tag, inner, after in zip(parts[1::3], parts[2::3], parts[3::3], strict=True):
            element = _INLINE[tag]("", unescape(inner))
            if element.tagname == "inline":
                element["classes"].append("n")
            pieces += [element, nodes.Text(unescape(after))]
        parent.replace(text, pieces)


def _drop_links_outside(app: Sphinx, document: nodes.document) -> None:
    """Make plain text of links to files that the site does not hold, as source files.

    A link to the repository's README.md leads to the opening page, which stands in its place. A link
    within its page has no file, and stays.
    """
    for link in list(document.findall(pending_xref)):
        # MyST gives links to files that it finds a domain; one without was not found. So a README.md that
        # the site has, such as a report's, is not meant below.
        missing = link["reftype"] == "myst" and not link.get("refdomain")
        target = link["reftarget"].partition("#")[0]
        if missing and target.endswith("../README.md"):
            link.attributes |= {"refdomain": "doc", "reftarget": app.config.root_doc}
            # The opening page does not have the headings of README.md.
            link["reftargetid"] = None
        elif missing and target:
            link.replace_self(nodes.inline("", link.astext()))


def _shorten_navigation(_: Sphinx, __: str, ___: str, context: dict[str, Any], ____: Any) -> None:
    """Change the theme's navigation: captions, and pages that lie below another page.

    Captions become headings of level 2 for screen readers. The pages below another are listed only
    where that page or one of them is shown.
    """
    tree = BeautifulSoup(context["furo_navigation_tree"], "html.parser")
    for caption in tree.select("p.caption"):
        caption["aria-level"] = "2"
    # An item that is not shown loses the button that unfolds it and its list, and gets the class of items
    # without pages below. All items with pages below are of level 1: the navigation has two levels.
    for item in tree.select("li.has-children:not(.current)"):
        for part in item.find_all(["input", "label", "ul"], recursive=False):
            part.decompose()
        item["class"] = "toctree-l1"
    context["furo_navigation_tree"] = str(tree)
