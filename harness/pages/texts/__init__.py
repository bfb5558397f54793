"""The prose of the pages: Markdown files with fields."""
