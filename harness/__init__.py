"""Harness: references, errors, timing, studies, cost laws, pick, and the command line."""

if __name__ != "polhode.harness":
    raise ImportError(f"this package is imported as 'polhode.harness', not as {__name__!r}")
