"""Supervision of faults that a robot does not report: unacknowledged DRIVEs, and a silent ring."""

from __future__ import annotations

import pytest

from drivers.denning.timeouts import CommandAckMonitor, EchoTimeout


def test_the_oldest_unacknowledged_drive_counts_once_acknowledgements_are_supported() -> None:
    monitor = CommandAckMonitor()
    for seq in range(4):
        monitor.sent(seq, 0.05 * seq)
    monitor.acknowledged(0)
    assert monitor.unacknowledged_s(9.0) == 0.0, "a robot may name the same DRIVE for ever"
    monitor.acknowledged(0)
    assert monitor.unacknowledged_s(9.0) == 0.0
    monitor.acknowledged(2)
    assert monitor.unacknowledged_s(0.55) == pytest.approx(0.4)
    assert 3 in monitor
    assert 2 not in monitor, "acknowledged, and all before it"
    assert monitor.unacknowledged_s(0.1) == 0.0, "the odometry is older than the DRIVE"
    monitor.acknowledged(200)
    assert monitor.unacknowledged_s(0.55) == pytest.approx(0.4), "never sent: ignored"
    monitor.forget()
    assert monitor.unacknowledged_s(9.0) == 0.0


def test_a_number_that_is_used_again_means_the_newer_drive() -> None:
    monitor = CommandAckMonitor()
    for k in range(300):
        monitor.sent(k % 256, 0.05 * k)
    monitor.acknowledged(43)
    assert monitor.unacknowledged_s(99.0) == 0.0, "the newest"
    monitor.sent(44, 15.0)
    monitor.sent(45, 15.05)
    monitor.acknowledged(44)
    assert monitor.unacknowledged_s(15.5) == pytest.approx(0.45)


def test_silence_expires_once_for_each_timeout() -> None:
    timeout = EchoTimeout(0.5)
    timeout.restart(10.0, bad=3)
    assert [timeout.expired(t) for t in (10.4, 10.5, 10.51, 10.6, 11.02)] == [False, False, True, False, True]
    timeout.restart(11.1, bad=3)
    assert not timeout.expired(11.5)


def test_corrupt_frames_count_from_the_last_echo_and_after_the_timeout_only() -> None:
    timeout = EchoTimeout(0.5)
    timeout.restart(10.0, bad=3)
    assert timeout.corrupt_frames(10.4, bad=7) == 0
    timeout.expired(10.6)
    assert timeout.corrupt_frames(10.6, bad=7) == 4
    timeout.restart(10.7, bad=7)
    assert timeout.corrupt_frames(11.3, bad=7) == 0
