"""Real nodes beside a real run: processes of the product, and a node that looks and drives. Needs ROS 2."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor

START_MAX_S = 90.0
"""On a busy machine."""
ROOT = Path(__file__).resolve().parents[4]


def environment(state: Path) -> dict[str, str]:
    """Return the environment of all processes of a test: its own state folder, and a domain of this process."""
    return {
        **os.environ, "PYTHONPATH": str(ROOT), "XDG_STATE_HOME": str(state), "PYTHONUNBUFFERED": "1",
        "ROS_DOMAIN_ID": str(domain()), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    }  # fmt: skip


def domain() -> int:
    """Return a domain for the tests of this process, below those whose ports the system gives away."""
    return 20 + os.getpid() % 80


@contextlib.contextmanager
def program(folder: Path, *arguments: str, module: str = "runtime.cli") -> Iterator[subprocess.Popen[bytes]]:
    """Run a module as a program while the context lasts; its output goes to a file in the folder."""
    log = folder / f"{arguments[0] if arguments else module}.log"
    with log.open("wb") as output:
        process = subprocess.Popen(
            [sys.executable, "-m", module, *arguments], env=environment(folder), cwd=ROOT, stdout=output,
            stderr=subprocess.STDOUT,
        )  # fmt: skip
        try:
            yield process
        finally:
            process.send_signal(signal.SIGTERM)
            try:
                process.wait(20.0)
            finally:
                process.kill()


class Node:
    """A node that keeps the newest message of each topic, and when the first one came."""

    def __init__(self) -> None:
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain())
        self.node = rclpy.create_node("looker", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self.newest: dict[str, Any] = {}
        self.began_s = time.monotonic()
        self.first_s: dict[str, float] = {}

    def keep(self, topic: str) -> Callable[[Any], None]:
        def take(message: Any) -> None:
            self.newest[topic] = message
            self.first_s.setdefault(topic, time.monotonic() - self.began_s)

        return take

    def look(self, topic: str, kind: Any, qos: Any) -> None:
        self.node.create_subscription(kind, topic, self.keep(topic), qos)

    def spin(self, seconds: float) -> None:
        end_s = time.monotonic() + seconds
        while (left_s := end_s - time.monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=left_s)

    def until(self, done: Callable[[], bool], timeout_s: float, what: str) -> float:
        """Spin until a condition holds; return how long that took."""
        began_s = time.monotonic()
        while not done():
            assert time.monotonic() - began_s < timeout_s, f"no {what} within {timeout_s} s"
            self._executor.spin_once(timeout_sec=0.02)
        return time.monotonic() - began_s

    def call(self, kind: Any, service: str) -> Any:
        client = self.node.create_client(kind, service)
        assert client.wait_for_service(timeout_sec=START_MAX_S)
        future = client.call_async(kind.Request())
        self.until(future.done, 20.0, service)
        return future.result()

    def close(self) -> None:
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown(context=self._context)
