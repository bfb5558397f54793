"""Markdown pages and figures from numbers; imports what measures."""
