"""The contract of drivers in pytest: `pytest --echolocate-family skippy`, wherever it is installed.

`echolocate_pytest` has the option, and registers this plug-in where it is given. The name is that of a robot, or its
file, or `module:FAMILY`, a `drivers.contract.family.Family`. What the robot cannot do is skipped, and named with what
follows from it.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Final

import pytest

from config.errors import UserError
from drivers.driver import DriverError

if TYPE_CHECKING:
    from drivers.contract.family import Family

PARTS: Final = ("connecting", "motion", "measuring", "failing")
OPTION: Final = "echolocate_family"
MARKERS: Final = (
    "needs(capability): a promise of robots that have it (drivers.capabilities)",
    "promise(id, …): verifies the promises with these IDs",
    "compiled: takes long without compiled kernels",
    "soak: the long form of another test",
)


class _Measurements:
    """The fixture of what is measured, where the repository's page of promises, which has its own, is not."""

    @pytest.fixture
    def measured(self) -> Callable[[str], None]:
        """Return what takes a measurement."""
        return lambda _text: None


def pytest_configure(config: pytest.Config) -> None:
    """Collect the contract, and nothing else.

    Raises
    ------
    pytest.UsageError
        The option names no robot that can be loaded.
    """
    for marker in MARKERS:
        config.addinivalue_line("markers", marker)
    pytest.register_assert_rewrite("drivers.contract.cable")
    from drivers.contract.family import find_family

    try:
        find_family(config.getoption(OPTION))
    except (UserError, DriverError, ImportError, AttributeError, TypeError) as error:
        raise pytest.UsageError(f"--echolocate-family {config.getoption(OPTION)}: {error}") from None
    config.args = [str(Path(__file__).with_name(f"{part}.py")) for part in PARTS]
    config.option.reportchars += "s"
    config.pluginmanager.register(_Measurements())


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out the long forms, unless markers are asked for."""
    if not config.option.markexpr:
        items[:] = [item for item in items if item.get_closest_marker("soak") is None]


@pytest.fixture
def family(request: pytest.FixtureRequest) -> Family:
    """Return the robot that the option names."""
    from drivers.contract.family import find_family

    return find_family(request.config.getoption(OPTION))


@pytest.fixture(autouse=True)
def _needs(request: pytest.FixtureRequest) -> None:
    """Skip what the robot cannot do."""
    needs = [mark.args[0] for mark in request.node.iter_markers("needs")]
    if needs and "family" in request.fixturenames:
        lacks = request.getfixturevalue("family").lacks
        if found := [lacks[name] for name in needs if name in lacks]:
            pytest.skip("; ".join(found))
