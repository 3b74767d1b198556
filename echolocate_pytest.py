"""The plug-in of pytest: `pytest --echolocate-family NAME` runs the contract of drivers on an installed robot.

pytest imports it in the tests of every project beside which echolocate is installed. So it is one module, whose name
no project has: `drivers` may be a package of theirs. Nothing else is imported unless the option is given.
"""

from __future__ import annotations

from typing import Final

import pytest

OPTION: Final = "--echolocate-family"


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option."""
    text = "run the contract of drivers on a robot: its name, its file, or module:FAMILY"
    parser.getgroup("echolocate").addoption(OPTION, metavar="NAME", default=None, help=text)


def pytest_configure(config: pytest.Config) -> None:
    """Let the contract be collected where the option is given.

    Raises
    ------
    pytest.UsageError
        A package of another project hides one that the contract is in.
    """
    if config.getoption(OPTION) is None:
        return
    from echolocate import hidden_package

    if (problem := hidden_package()) is not None:
        raise pytest.UsageError(f"{OPTION}: {problem}; or start it in another folder")
    from drivers.contract import plugin

    config.pluginmanager.register(plugin)
