"""Fixtures of the measurements by the wall clock, and their figures at the end of a run.

The compiled kernels, the state folder and the environment are prepared as for the tests. A measurement needs an idle
machine: it may fail while other programs run, and is therefore no part of `make test`.
"""

from __future__ import annotations

from collections.abc import Callable

import pytest

from tests.conftest import _state_folder, warm_kernels
from tests.promises import MEASURED

__all__ = ["_state_folder", "warm_kernels"]


@pytest.fixture
def measured(request: pytest.FixtureRequest) -> Callable[[str], None]:
    """Return a function that adds a line to the figures of this run."""
    return lambda text: request.node.user_properties.append((MEASURED, text))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    figures = [
        f"{report.nodeid}: {text}"
        for report in terminalreporter.getreports("passed")
        for key, text in report.user_properties
        if key == MEASURED and report.when == "call"
    ]
    if figures:
        terminalreporter.section("measured")
    for line in figures:
        terminalreporter.line(line)
