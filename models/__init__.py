"""Physics: the ellipsoid, the scene, one module per form of the equations of motion, and their catalogue."""

if __name__ != "polhode.models":
    raise ImportError(f"this package is imported as 'polhode.models', not as {__name__!r}")
