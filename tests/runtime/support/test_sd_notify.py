"""Notifications to the service manager: sent in time, bounded, and never waited for."""

from __future__ import annotations

import contextlib
import os
import socket
from pathlib import Path

import pytest

from runtime.support.sd_notify import STATUS_MAX, SdNotifier


@pytest.mark.parametrize("kind", ["path", "abstract"])
def test_the_manager_s_socket_is_a_path_or_an_abstract_name(tmp_path: Path, kind: str) -> None:
    address = str(tmp_path / "notify") if kind == "path" else f"@echolocate-test-{os.getpid()}"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as ears:
        ears.bind("\0" + address[1:] if address.startswith("@") else address)
        ears.settimeout(0.0)
        with SdNotifier.from_environment({"NOTIFY_SOCKET": address}) as notifier:
            notifier.alive(0.0)
        assert ears.recv(100) == b"READY=1"
        assert notifier.lost == 0


def test_no_manager() -> None:
    for notifier in (
        SdNotifier(),
        SdNotifier.from_environment({}),
        SdNotifier.from_environment({"NOTIFY_SOCKET": "host:9"}),
    ):
        with notifier:
            notifier.alive(1.0)
            notifier.status("DRIVE")
            notifier.stopping()
        assert notifier.lost == 0


def test_missing_or_blocked_manager_does_not_block_the_run(tmp_path: Path) -> None:
    path = str(tmp_path / "notify")
    environment = {"NOTIFY_SOCKET": path, "WATCHDOG_USEC": "400000", "WATCHDOG_PID": str(os.getpid())}
    with SdNotifier.from_environment(environment) as notifier:
        notifier.alive(0.0)
        assert notifier.lost == 2, "READY and WATCHDOG"
        assert notifier.last_error is not None
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as ears:
            ears.bind(path)
            for k in range(10_000):
                notifier.alive(1.0 + k)
                if notifier.lost > 2:
                    break
            assert notifier.lost == 3, "the socket is full, and the run did not wait"
            assert ears.recv(100) == b"READY=1", "sent again once the manager listens"
            assert ears.recv(100) == b"WATCHDOG=1"
            notifier.alive(1e6)
            assert notifier.lost == 3, "and there is room again"


def test_the_watchdog_is_fed_in_time_and_no_more(tmp_path: Path) -> None:
    path = str(tmp_path / "notify")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as ears:
        ears.bind(path)
        ears.settimeout(0.0)
        received: list[str] = []

        def hear() -> None:
            with contextlib.suppress(BlockingIOError):
                while True:
                    received.append(ears.recv(4096).decode())

        with SdNotifier(path, 2.0) as notifier:
            for cycle in range(200):
                notifier.alive(0.05 * cycle)
                hear()
            for _ in range(2):
                notifier.status("SAFE_STOP: " + "x\ny " * STATUS_MAX)
            hear()
    assert received.count("READY=1") == 1
    assert 19 <= received.count("WATCHDOG=1") <= 21
    (status,) = [line for line in received if line.startswith("STATUS=")]
    assert "\n" not in status
    assert len(status) <= STATUS_MAX + len("STATUS=")


def test_watchdog_of_another_process_is_ignored() -> None:
    other = {"NOTIFY_SOCKET": "@absent", "WATCHDOG_USEC": "1000000", "WATCHDOG_PID": str(os.getpid() + 1)}
    with SdNotifier.from_environment(other) as notifier:
        notifier.alive(0.0)
        assert notifier.lost == 1, "READY alone"
