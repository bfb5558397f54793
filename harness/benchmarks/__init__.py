"""Forms and solvers under pytest-benchmark: the suite, its pytest plug-in, and the fixture for tests of one's own.

``pytest --pyargs polhode.harness.benchmarks`` runs the suite.
"""
