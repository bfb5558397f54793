"""A hook of mkdocs: links that lead out of `docs/` go from build/site/ to the files of the repository."""


def on_page_markdown(markdown: str, **_: object) -> str:
    """The page's text with such links."""
    return markdown.replace("](../", "](../../").replace("](plug-in", "](../../docs/plug-in")
