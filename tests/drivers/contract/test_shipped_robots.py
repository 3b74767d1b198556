"""Every robot file that is shipped: its emulated robot answers its driver, fires its pattern, drives and stops."""

from __future__ import annotations

from dataclasses import replace

import pytest

from config.files import list_shipped
from config.load import load_robot
from drivers.contract.measuring import fired, sets_of
from drivers.firing_pattern import firing_pattern
from drivers.messages import Flags
from drivers.registry import SHIPPED
from tests.drivers.contract.families import FAMILIES


def test_every_shipped_family_is_under_contract() -> None:
    assert SHIPPED.keys() <= {family.name for family in FAMILIES.values()}


@pytest.mark.parametrize("name", list_shipped("robots"))
def test_it_connects_fires_drives_and_stops(name: str) -> None:
    robot = load_robot(name)
    family = replace(FAMILIES[robot.robot.driver], robot=robot)
    cable = family.driving()
    pattern = firing_pattern(robot.ring)
    cable.run(pattern.cycle_s + 0.3)
    assert {fired(firing) for firing in cable.firings} == sets_of(robot.ring)
    cable.driver.halt()
    cable.run(0.5)
    assert cable.robot.truth.twist.v == 0.0
    assert cable.odometry[-1].flags & Flags.LATCHED
