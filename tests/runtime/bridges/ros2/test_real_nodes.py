"""The bridge beside a real run and real nodes: `make ros2` installs ROS 2 and runs these."""

from __future__ import annotations

import asyncio
import os
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from drivers import ros_tf
from runtime.bridges.console_client import ConsoleClient, connect
from runtime.support.console_address import find_console

pytestmark = [
    pytest.mark.soak,
    pytest.mark.ros2,
    pytest.mark.realtime,
    pytest.mark.filterwarnings("default::DeprecationWarning"),  # of ROS's own packages
]

GRID = ("--set", "perception.grid.method=directed")
STOP_MAX_S = 0.3
CPU_MAX = 0.15


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A run among six drums, and its bridge; the folder of both."""
    from tests.runtime.bridges.ros2.ros_case import START_MAX_S, Node, program

    folder = tmp_path_factory.mktemp("ros2")
    with ExitStack() as stack:
        stack.enter_context(program(folder, "run", "--headless", "--no-record", "--seconds", "300", *GRID))
        bridge = stack.enter_context(program(folder, "ros2"))
        (folder / "bridge.pid").write_text(str(bridge.pid))
        node = Node()
        stack.callback(node.close)
        from std_msgs.msg import String

        node.look("mode", String, latched())
        node.until(lambda: "mode" in node.newest and node.newest["mode"].data == "DRIVE", START_MAX_S, "DRIVE")
        node.spin(15.0)  # until it has recognised what it passes
        yield folder


def latched() -> Any:
    from rclpy.qos import DurabilityPolicy, QoSProfile

    return QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@pytest.mark.usefixtures("run")
def test_others_see_the_robot_within_two_seconds(measured: Callable[[str], None]) -> None:
    from diagnostic_msgs.msg import DiagnosticArray
    from nav_msgs.msg import OccupancyGrid, Odometry
    from rclpy.qos import qos_profile_sensor_data
    from sensor_msgs.msg import Range
    from visualization_msgs.msg import MarkerArray

    from tests.runtime.bridges.ros2.ros_case import Node

    node = Node()
    try:
        for sensor in range(24):
            node.look(f"sonar/s{sensor:02d}", Range, qos_profile_sensor_data)
        node.look("odom", Odometry, 10)
        node.look("grid", OccupancyGrid, latched())
        node.look("objects", MarkerArray, 10)
        node.look("/diagnostics", DiagnosticArray, 10)
        ros_tf.subscribe(node.node, "/tf", node.keep("/tf"), 100)
        ros_tf.subscribe(node.node, "/tf_static", node.keep("/tf_static"), latched())
        node.began_s = time.monotonic()
        node.until(lambda: len(node.first_s) == 30, 20.0, "all topics")
        worst_s = max(node.first_s.values())
        assert worst_s < 2.0
        parents = {f.child: f.parent for t in ("/tf", "/tf_static") for f in ros_tf.decode(node.newest[t])}
        assert [parents[name] for name in ("sonar_05", "ring", "base_link")] == ["ring", "base_link", "odom"]
        assert "odom" not in parents, "nothing localizes this run, so it has no map"
        assert max(node.newest["grid"].data) > 50
        assert any(marker.type == 3 for marker in node.newest["objects"].markers)
        measured(f"24 ranges, odometry, frames, objects, grid and diagnostics seen within {worst_s:.2f} s")
    finally:
        node.close()


def cpu_s(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def test_the_bridge_takes_little_of_a_core(run: Path, measured: Callable[[str], None]) -> None:
    pid = int((run / "bridge.pid").read_text())
    before_s, began_s = cpu_s(pid), time.monotonic()
    time.sleep(10.0)
    share = (cpu_s(pid) - before_s) / (time.monotonic() - began_s)
    assert share <= CPU_MAX
    measured(f"bridge: {share:.1%} of a core at 20 states/s")


async def until_speed(client: ConsoleClient, test: Callable[[float], bool], what: str) -> float:
    """Return when a state says that a velocity is requested that passes the test."""
    async with asyncio.timeout(20.0):
        async for message in client.messages():
            request = message.get("drive_request", {})
            if request.get("kind") == "teleoperate" and test(request["v"]):
                return time.monotonic()
    raise AssertionError(what)


def arm_again() -> None:
    from std_srvs.srv import Trigger

    from tests.runtime.bridges.ros2.ros_case import Node

    node = Node()
    try:
        assert node.call(Trigger, "halt").success
        node.spin(0.5)
        assert node.call(Trigger, "arm").success
        node.spin(1.0)
    finally:
        node.close()


async def test_the_robot_stops_when_the_node_that_drives_it_is_killed(
    run: Path, measured: Callable[[str], None]
) -> None:
    from tests.runtime.bridges.ros2.ros_case import program

    arm_again()
    took_s = []
    async with connect(find_console(run / "echolocate")) as client:
        for _ in range(5):
            with program(run, "-0.1", module="tests.runtime.bridges.ros2.drive_forward") as driver:
                await until_speed(client, lambda v: v < 0.0, "motion")
                driver.send_signal(signal.SIGKILL)
                killed_s = time.monotonic()
                took_s.append(await until_speed(client, lambda v: v == 0.0, "stop") - killed_s)
    assert max(took_s) <= STOP_MAX_S
    measured(f"velocity zero ≤ {max(took_s):.3f} s after the kill of its sender, 5 times")


async def test_the_robot_stops_when_the_bridge_is_killed(run: Path, measured: Callable[[str], None]) -> None:
    """The last test of this module: its bridge is gone afterwards."""
    from tests.runtime.bridges.ros2.ros_case import program

    arm_again()
    async with connect(find_console(run / "echolocate")) as client:
        with program(run, "-0.1", module="tests.runtime.bridges.ros2.drive_forward"):
            await until_speed(client, lambda v: v < 0.0, "motion")
            os.kill(int((run / "bridge.pid").read_text()), signal.SIGKILL)
            killed_s = time.monotonic()
            took_s = await until_speed(client, lambda v: v == 0.0, "stop") - killed_s
    assert took_s <= STOP_MAX_S
    measured(f"velocity zero {took_s:.3f} s after the kill of the bridge")
