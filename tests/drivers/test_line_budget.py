"""A line too slow for its traffic is refused where the robot is described, with what would do, for every family."""

from __future__ import annotations

import random

import pytest

from config.load import load_robot
from config.robot import LinkConfig, RobotConfig
from drivers.firing_pattern import FiringError
from drivers.line_budget import BURST_BYTES, NETWORK_BYTES_S, ReceiveBudget, refuse_slow_line
from drivers.registry import make_driver
from runtime.cli.app import run_command


def at(name: str, baud: int, port: str | None = None) -> RobotConfig:
    config = load_robot(name)
    return config.model_copy(update={"link": config.link.model_copy(update={"baud": baud, "port": port})})


@pytest.mark.parametrize(
    ("name", "too_slow", "enough"),
    [("p3dx", 4800, 9600), ("powerbot", 4800, 9600), ("b21r-both", 19200, 38400), ("magellan", 19200, 38400)],
)
def test_a_line_too_slow_for_its_traffic_is_refused(name: str, too_slow: int, enough: int) -> None:
    make_driver(at(name, enough))
    with pytest.raises(FiringError, match=rf"a line of {too_slow} baud carries .*set link.baud to {enough} or more"):
        make_driver(at(name, too_slow))
    make_driver(at(name, too_slow, "socket://robot:7000"))


@pytest.mark.parametrize(
    ("fixed_bytes_s", "firing_bytes", "remedy"),
    [
        (
            100.0,
            400.0,
            r"; set link\.baud to 9600 or more, .* robot, or ring\.firing\.step_period_s to 1\.205 or more$",
        ),
        (100.0, 1e7, r"; set ring\.firing\.step_period_s to [\d.]+ or more$"),
        (1e7, 10.0, r"; have the robot send odometry less often, or connect it by a network$"),
    ],
)
def test_what_would_do_is_a_sentence(fixed_bytes_s: float, firing_bytes: float, remedy: str) -> None:
    with pytest.raises(FiringError, match=remedy):
        refuse_slow_line(LinkConfig(port="/dev/ttyUSB0", baud=4800), fixed_bytes_s, firing_bytes, 1.0)


def test_check_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["check", "hallway", "--set", "robot=magellan", "--set", "link.baud=9600"]) != 0
    assert "set link.baud to 38400 or more" in capsys.readouterr().err


@pytest.mark.promise("P22")
@pytest.mark.parametrize("seed", range(30))
def test_no_flood_gives_a_driver_more_than_the_budget(seed: int) -> None:
    """Any port and speed, any rate and size of the pieces: bytes in any second and at once are bounded, and named."""
    rng = random.Random(seed)
    port = rng.choice((None, "/dev/ttyUSB0", "socket://robot:8101"))
    link = LinkConfig(port=port, baud=rng.choice((9600, 38400, 115200, 921600)))
    rate = NETWORK_BYTES_S if port is not None and "://" in port else 2.0 * link.baud / 10.0
    budget, accepted, run_s = ReceiveBudget(link), 0, 50.0
    flood_bytes_s = rate * 10.0 ** rng.uniform(0.5, 2.5)
    for _ in range(2000):
        piece = bytes(rng.randrange(1, 4097))
        run_s += len(piece) / flood_bytes_s
        accepted += len(piece) if budget.accepts(piece, run_s) else 0
    assert accepted <= BURST_BYTES + rate * (run_s - 50.0)
    assert budget.dropped > 0
    assert "more bytes than a robot sends" in (budget.flood(run_s) or "")
    assert budget.flood(run_s + 1.5) is None


@pytest.mark.parametrize("baud", [9600, 38400, 115200])
def test_a_full_line_and_what_waited_for_a_suspended_process_are_read(baud: int) -> None:
    budget = ReceiveBudget(LinkConfig(port="/dev/ttyUSB0", baud=baud))
    for _ in range(4):
        assert budget.accepts(bytes(4096), 10.0)
    for k in range(2000):
        assert budget.accepts(bytes(baud // 1000), 10.0 + 0.01 * k)
    assert budget.flood(30.0) is None
