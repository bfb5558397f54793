"""The plug-in, where the installation does not declare it: an old one, or a tree on PYTHONPATH."""

import pytest


def pytest_addoption(parser: pytest.Parser, pluginmanager: pytest.PytestPluginManager) -> None:
    if not pluginmanager.has_plugin("polhode"):
        pluginmanager.import_plugin("polhode.harness.benchmarks.plugin")
