"""Measuring and fitting the laws, and the held-out test of `pick`; imports `api`."""

# Here, since `--help` names them: training scenes of the short stratum, and the first seed of
# held-out ones.
TRAINING_SCENES, HELD_OUT_SEED = 110, 1765
