"""The look of solvers, and the figures that pages, site and Python share; imports `analysis`."""
