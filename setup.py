"""The rooms lie beside each other in the repository and under `polhode` where it is installed."""

from setuptools import find_packages, setup

rooms = ("models", "solvers", "harness")
found = find_packages(include=[pattern for room in rooms for pattern in (room, f"{room}.*")])
setup(packages=["polhode", *(f"polhode.{name}" for name in found)])
