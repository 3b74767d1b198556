"""The driver registry: shipped drivers, drivers of installed packages, and what is said where there is none."""

from __future__ import annotations

import subprocess
import sys
import types
from importlib.metadata import EntryPoint

import pytest

from config.load import load_robot
from config.robot import DriverConfig, FiringConfig, RobotConfig
from config.world import WorldConfig
from drivers import registry
from drivers.denning.device import DenningDevice
from drivers.denning.driver import DenningDriver
from drivers.driver import DriverError
from drivers.latched_ranges import FreshDriver
from drivers.registry import GROUP, driver_names, known_drivers, make_device, make_driver


def robot_with_driver(name: str) -> RobotConfig:
    return load_robot("denning").model_copy(update={"robot": DriverConfig(driver=name)})


def install(monkeypatch: pytest.MonkeyPatch, name: str, value: str) -> None:
    """Make an entry point known as if an installed package provided it."""
    entry = EntryPoint(name, value, GROUP)
    monkeypatch.setattr(registry, "plugged", lambda group: {name: entry} if group == GROUP else {})


def test_a_robot_file_without_a_driver_gets_the_denning() -> None:
    config = load_robot("denning")
    assert config.robot.driver == "denning"
    assert isinstance(make_driver(config), DenningDriver)
    assert isinstance(make_device(config, WorldConfig(), 1), DenningDevice)


def test_every_shipped_driver_loads() -> None:
    for entry in registry.SHIPPED.values():
        family = entry.load()
        assert callable(family.make_driver)
        assert callable(family.make_device)


def test_an_unknown_driver_is_refused_with_the_known_ones_named() -> None:
    with pytest.raises(DriverError, match=r'robot.driver = "nonesuch": no such driver; known drivers: .*denning'):
        make_driver(robot_with_driver("nonesuch"))
    with pytest.raises(DriverError, match="known drivers"):
        make_device(robot_with_driver("nonesuch"), WorldConfig(), 1)


def test_an_installed_package_adds_a_driver(monkeypatch: pytest.MonkeyPatch) -> None:
    module = types.ModuleType("a_robot_package")
    made = DenningDriver(load_robot("denning"))
    module.make_driver = lambda _config: made  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, module.__name__, module)
    install(monkeypatch, "other", module.__name__)
    assert "other" in known_drivers()
    assert driver_names() == ("denning", "arcos", "rflex", "ros2", "other")
    assert make_driver(robot_with_driver("other")).drive == made.drive


def test_a_shipped_driver_takes_precedence(monkeypatch: pytest.MonkeyPatch) -> None:
    install(monkeypatch, "denning", "a_package_that_is_not_there")
    assert isinstance(make_driver(load_robot("denning")), DenningDriver)


def test_a_driver_that_cannot_be_loaded_is_refused_with_its_package_named(monkeypatch: pytest.MonkeyPatch) -> None:
    install(monkeypatch, "broken", "a_package_that_is_not_there.robot")
    with pytest.raises(DriverError, match=r"cannot be loaded from a_package_that_is_not_there.robot"):
        make_driver(robot_with_driver("broken"))


def test_an_installed_driver_may_repeat_last_values(monkeypatch: pytest.MonkeyPatch) -> None:
    """One whose family counts frames names what fired."""
    module = types.ModuleType("a_latching_package")
    module.make_driver = DenningDriver  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, module.__name__, module)
    install(monkeypatch, "mine", "drivers.denning.family")
    assert isinstance(make_driver(robot_with_driver("mine")), DenningDriver)
    install(monkeypatch, "mine", module.__name__)
    assert isinstance(make_driver(robot_with_driver("mine")), FreshDriver)
    all_at_once = FiringConfig(sets=(tuple(range(24)),), step_period_s=0.1)
    ring = load_robot("denning").ring.model_copy(update={"firing": all_at_once})
    assert isinstance(make_driver(robot_with_driver("mine").model_copy(update={"ring": ring})), DenningDriver)


def test_once_imported_families_are_named_without_a_further_import() -> None:
    """An import takes a tenth of a second, and a HALT of the cycle in which a line fails would wait for it."""
    check = (
        "import sys\nfrom drivers.registry import import_families, other_robot\nimport_families()\n"
        "before = set(sys.modules)\nassert other_robot('denning', b'') is None\nassert set(sys.modules) == before"
    )
    subprocess.run([sys.executable, "-c", check], check=True, timeout=120.0)
