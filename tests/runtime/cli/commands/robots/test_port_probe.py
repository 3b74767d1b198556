"""What answers on a port: which robot is chosen, and how its battery is described."""

from __future__ import annotations

import pytest

from config.load import load_robot
from config.robot import RobotConfig
from drivers.link import Link, LinkError
from runtime.cli.commands.robots import port_probe
from tests.hil.machine import TIMEOUT_S


@pytest.mark.parametrize(
    ("fired", "chosen"),
    [
        ({"atrvjr": 16, "b21r": 24, "b21r-both": 24, "magellan": 8}, "b21r"),
        ({"atrvjr": 13, "b21r": 8, "magellan": 16}, "magellan"),
        ({"atrvjr": 5, "b21r": 20}, "b21r"),
        ({"atrvjr": 3}, "atrvjr"),
    ],
)
async def test_of_robots_that_do_not_name_themselves_the_one_of_which_all_or_most_sensors_fire_is_chosen(
    fired: dict[str, int], chosen: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    robots = {name: load_robot(name) for name in ("atrvjr", "b21r", "b21r-both", "denning", "magellan")}
    asked = list[str]()

    async def answer(_port: str, config: RobotConfig, *, again: bool) -> port_probe._Answer:
        assert again == bool(asked)
        (name,) = (name for name, known in robots.items() if known is config)
        asked.append(name)
        if config.robot.driver != "rflex":
            return port_probe._Answer(has_answered=False)
        count = fired.get(name, 0)
        is_whole = count == len(config.ring.mounts)
        return port_probe._Answer(has_answered=True, text=name, fired=count, is_whole=is_whole)

    monkeypatch.setattr(port_probe, "_try", answer)
    assert await port_probe.probe_port("/dev/ttyUSB0", robots) == port_probe.Finding(chosen, (chosen,))


async def test_a_port_that_is_still_busy_with_the_robot_tried_before_is_opened_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A bridge of one client refuses the next one until it has seen the last one hang up."""
    opened = list[bool]()

    async def open_once(_link: Link) -> None:
        opened.append(len(opened) % 4 == 0)
        if not opened[-1]:
            raise LinkError("refuses the connection")

    monkeypatch.setattr(Link, "open_once", open_once)
    monkeypatch.setattr(port_probe, "AGAIN_MAX_S", TIMEOUT_S)
    robots = {name: load_robot(name) for name in ("denning", "p3dx", "b21r")}
    assert (await port_probe.probe_port("socket://localhost:1", robots)).robot is None
    assert sum(opened) == len(robots), "each family is tried"
    monkeypatch.setattr(port_probe, "AGAIN_MAX_S", 0.0)
    opened.clear()
    finding = await port_probe.probe_port("socket://localhost:1", robots)
    assert (finding.said, opened) == (("refuses the connection",), [True, False])


def test_a_battery_that_is_low_is_named_with_and_without_its_voltage() -> None:
    assert port_probe._battery(10.94, is_low=True) == "battery 10.9 V, low"
    assert port_probe._battery(None, is_low=True) == "battery low"
