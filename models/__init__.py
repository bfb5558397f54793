"""Physics: the ellipsoid, the scene, the forms of the equations and their catalogue.

Imports no other room: `path_solver` is handed the one function of a solver that models call.
"""

if __name__ != "polhode.models":
    raise ImportError(f"this package is imported as 'polhode.models', not as {__name__!r}")
