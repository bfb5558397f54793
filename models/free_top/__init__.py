"""Torque-free motion: elliptic functions, polhodes, periods; imports the base types of `models`."""
