"""Many particles: starts, statistics, sweeps, engines; imports `solvers.ensembles` and `studies`."""
