"""Answers of `solve`: rules for a method, confirmed runs, stated errors; imports `references`."""
