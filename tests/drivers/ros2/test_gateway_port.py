"""The line to the process that holds ROS, with programs in its place."""

from __future__ import annotations

import pytest

from drivers.ros2 import gateway_port
from drivers.ros2.gateway_port import GatewayPort
from drivers.serial_port import GatewayError, LinkError, opening_error
from tests.drivers.ros2.robot import CONFIG


def test_where_ros_is_missing_the_port_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gateway_port, "MODULE", "tests.drivers.ros2.gateway_without_ros")
    with pytest.raises(GatewayError, match="ROS 2 is not installed here") as caught:
        GatewayPort(CONFIG)
    error = opening_error(CONFIG.link, caught.value)
    assert isinstance(error, LinkError)
    assert "\n" not in str(error)


def test_a_process_that_is_ready_is_an_open_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gateway_port, "MODULE", "tests.drivers.ros2.gateway_that_echoes")
    port = GatewayPort(CONFIG)
    assert port.write(b"abc") == 3
    port._socket.settimeout(20.0)
    assert port._socket.recv(3) == b"abc"
    port.close()
