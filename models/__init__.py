"""Physics: the ellipsoid, the scene, the forms of the equations and their catalogue.

Imports no other room, but for the solver that `second_order.path` uses.
"""

if __name__ != "polhode.models":
    raise ImportError(f"this package is imported as 'polhode.models', not as {__name__!r}")
