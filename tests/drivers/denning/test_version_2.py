"""Version 2 of the protocol: rings of other sizes, fine ranges, listeners; and how both ends agree on a version."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest

from config.load import load_robot
from config.robot import BodyConfig, DriverConfig, RingConfig, RobotConfig
from config.world import AcousticsConfig, WallConfig, WorldConfig
from drivers.denning.device import DenningDevice
from drivers.denning.driver import DenningDriver
from drivers.denning.frames import (
    CAN_LISTEN,
    Ack,
    Echo,
    Echo2,
    Hello,
    Ident,
    Listen,
    Nak,
    NakCode,
    Pattern,
)
from drivers.driver import DriverError, LineState
from drivers.firing_pattern import FiringError
from drivers.messages import CrossPaths
from tests.drivers.cable import Cable
from tests.drivers.device_host import Host
from tests.drivers.driver_harness import IDENT, DriverHarness
from tests.drivers.vectors import THIRDS

WALL = WorldConfig(wall=(WallConfig(x1_m=2.0, y1_m=-9.0, x2_m=2.0, y2_m=9.0),))


def robot(count: int = 8, resolution_m: float = 0.001, protocol: int | None = None, **ring: Any) -> RobotConfig:
    settings: dict[str, Any] = {
        "count": count, "radius_m": 0.1, "beam_half_angle_deg": 12.0, "resolution_m": resolution_m,
        "range_min_m": 0.02, "range_max_m": 4.0, "firing": "opposite_pairs",
    }  # fmt: skip
    return RobotConfig(
        robot=DriverConfig(protocol=protocol),
        ring=RingConfig(**settings | ring),
        body=BodyConfig(radius_m=0.12, speed_max_m_s=0.4, turn_max_rad_s=2.0),
    )


FINE_IDENT = Ident(0, 2, 8, 100, 500, 20, 0xB001, "ring", 172, 0)


def greeted(config: RobotConfig, ident: Ident) -> DriverHarness:
    harness = DriverHarness(config)
    harness.ident = ident
    harness.open()
    harness.handshake()
    return harness


# The host agrees on a version.


def test_the_host_asks_for_version_2_and_goes_on_with_1_if_that_is_refused() -> None:
    harness = DriverHarness()
    harness.open()
    assert harness.received() == [Hello(0, 2)]
    harness.send(Nak(0, 0, NakCode.VALUE_OUT_OF_RANGE))
    assert harness.received() == [Hello(1, 1)]
    harness.send(IDENT)
    assert isinstance(harness.received()[0], Pattern)
    harness.send(Ack(0, 2))
    assert harness.state() is LineState.READY
    assert harness.robot.problem is None
    harness.run(2.0, t_us=0)
    assert harness.state() is LineState.READY, "its further HELLOs, sent as no echo comes, ask for version 1"


def test_a_robot_that_refuses_every_version_is_down() -> None:
    harness = DriverHarness()
    harness.open()
    for seq in range(2):
        harness.received()
        harness.send(Nak(0, seq, NakCode.VALUE_OUT_OF_RANGE))
    assert harness.state() is LineState.DOWN
    assert "refuses HELLO" in (harness.robot.problem or "")
    harness.pass_time(0.6)
    assert harness.received() == [Hello(2, 2)], "after an update it may speak the newer one"


def test_an_ident_of_version_1_in_answer_to_2_is_accepted() -> None:
    harness = greeted(robot(count=24), Ident(0, 1, 24, 100, 500, 20, 1, "old"))
    assert harness.state() is LineState.READY


def test_the_robot_file_can_name_the_version() -> None:
    harness = DriverHarness(robot(protocol=1, resolution_m=0.03048))
    harness.open()
    assert harness.received() == [Hello(0, 1)]
    for make in (DenningDriver, lambda config: DenningDevice(config, WALL, 1)):
        with pytest.raises(DriverError, match=r"robot\.protocol = 3: this driver speaks versions 1 to 2"):
            make(robot(protocol=3))


@pytest.mark.parametrize(
    ("resolution_m", "ident", "said"),
    [
        (
            0.001,
            Ident(0, 1, 8, 100, 500, 20, 1, "old"),
            r"steps of 0\.03048 m.*ring\.resolution_m = 0\.001",
        ),
        (0.005, Ident(0, 2, 8, 100, 500, 20, 1, "r", 10_000, 0), r"steps of 0\.01 m"),
        (0.03048, Ident(0, 1, 8, 100, 500, 20, 1, "old"), None),
        (0.0, FINE_IDENT, None),
        (0.001, Ident(0, 2, 8, 100, 500, 20, 1, "r", 1000, 0), None),
    ],
)
def test_a_resolution_finer_than_the_line_is_said_once(resolution_m: float, ident: Ident, said: str | None) -> None:
    harness = greeted(robot(resolution_m=resolution_m), ident)
    notes = list(harness.robot.take_received().notes)
    harness.robot.line_closed()
    harness.open()
    harness.handshake()
    notes += harness.robot.take_received().notes
    assert len(notes) == (said is not None)
    if said is not None:
        assert re.search(said, notes[0])


# The host reads version 2.


def test_ranges_are_counts_of_the_robots_unit_and_listeners_are_kept_apart() -> None:
    harness = greeted(robot(), FINE_IDENT)
    harness.odom(100_000)
    harness.send(Echo2(0, 110_000, 0, 0b10011, 0b100, (10_000, 0, 65535, 5000)))
    harness.odom(120_000)
    (firing,) = harness.robot.take_received().firings
    np.testing.assert_array_equal(
        firing.ranges_m, [10_000 * (1e-6 * 172), *[math.nan] * 3, math.inf, *[math.nan] * 3]
    )
    assert firing.cross_paths is not None
    assert firing.cross_paths.transmitters.tolist() == [1]
    assert firing.cross_paths.listeners.tolist() == [2]
    assert firing.cross_paths.half_paths_m.tolist() == [5000 * (1e-6 * 172)]


def test_a_listener_with_a_fault_or_beyond_the_window_is_left_out() -> None:
    harness = greeted(robot(), FINE_IDENT)
    beyond = math.ceil(131 * 0.03048 / 172e-6) + 1
    heard: list[CrossPaths | None] = []
    for k, counts in enumerate([(900, 0, 65535), (900, 0, beyond), (900, 900, beyond)]):
        harness.odom(100_000 + 100_000 * k)
        harness.send(Echo2(0, 110_000 + 100_000 * k, 0, 0b1, 0b110, counts))
        harness.odom(120_000 + 100_000 * k)
        heard += [firing.cross_paths for firing in harness.robot.take_received().firings]
    first, second, third = heard
    assert first is not None
    assert (first.listeners.tolist(), first.half_paths_m.tolist()) == ([2], [math.inf])
    assert second is None
    assert third is not None
    assert third.listeners.tolist() == [1]
    assert harness.robot.stamper.out_of_window.count == 2


# The host asks sensors to listen.

LISTENING = {"sets": [[0], [4]], "listen": [[1, 7], []]}
EARS_IDENT = Ident(0, 2, 8, 100, 500, 20, 0xB001, "ring", 172, CAN_LISTEN)


def test_listen_follows_each_pattern_that_the_robot_accepts() -> None:
    harness = DriverHarness(robot(firing=LISTENING))
    harness.ident = EARS_IDENT
    harness.open()
    assert harness.answer() == [Hello(0, 2)]
    assert [type(frame) for frame in harness.answer()] == [Pattern]
    assert harness.answer() == [Listen(2, (0b1000_0010, 0))]
    assert harness.state() is LineState.READY
    harness.robot.set_firing(robot(firing=LISTENING | {"listen": [[1], []]}).ring)
    assert [type(frame) for frame in harness.answer()] == [Pattern]
    assert harness.answer() == [Listen(4, (0b10, 0))]
    harness.robot.set_firing(robot(firing={"sets": [[0], [4]]}).ring)
    assert [type(frame) for frame in harness.answer()] == [Pattern]
    assert harness.answer() == [], "a new PATTERN clears what listens"


@pytest.mark.parametrize(
    ("ident", "said"),
    [
        (Ident(0, 1, 8, 100, 500, 20, 1, "old"), "'old' speaks version 1 of the protocol, which has no listeners"),
        (FINE_IDENT, "'ring' cannot listen; remove ring.firing.listen_preset"),
    ],
)
def test_a_robot_that_cannot_listen_is_refused(ident: Ident, said: str) -> None:
    harness = DriverHarness(robot(firing=LISTENING))
    harness.ident = ident
    harness.open()
    harness.answer()
    assert harness.state() is LineState.DOWN
    assert said in (harness.robot.problem or "")
    plain = greeted(robot(), ident)
    with pytest.raises(FiringError, match="asks sensors to listen"):
        plain.robot.set_firing(robot(firing=LISTENING).ring)
    assert plain.received() == [], "the pattern in force stays"


def test_a_robot_that_refuses_listen_is_down_with_the_remedy() -> None:
    harness = DriverHarness(robot(firing=LISTENING))
    harness.ident = EARS_IDENT
    harness.open()
    harness.answer()
    harness.answer()
    (listen,) = harness.received()
    harness.send(Nak(0, listen.seq, NakCode.VALUE_OUT_OF_RANGE))
    assert harness.state() is LineState.DOWN
    assert "refuses LISTEN" in (harness.robot.problem or "")
    assert "remove ring.firing.listen_preset" in (harness.robot.problem or "")


def test_the_shipped_robot_with_ears_hears_cross_paths_of_a_wall() -> None:
    cable = Cable(config=load_robot("ears"), world=WALL, twist=None)
    cable.plug()
    cable.run(1.0)
    heard = [firing.cross_paths for firing in cable.firings if firing.cross_paths is not None]
    assert len(heard) >= 10
    # The image of sensor 0 behind the wall at 2 m, seen from sensor 1; sensor 0 looks straight at the wall.
    step = 2.0 * math.pi / 24
    x, y = 0.381 * math.cos(step), 0.381 * math.sin(step)
    half_path_m = 0.5 * math.hypot(4.0 - 0.381 - x, y)
    found = {
        half
        for paths in heard
        for pair, half in zip(zip(paths.transmitters, paths.listeners, strict=True), paths.half_paths_m, strict=True)
        if pair == (0, 1)
    }
    assert found == {round(1e3 * half_path_m) * 1e-3}


def test_a_range_beyond_the_window_is_dropped_but_for_the_rounding_of_a_count() -> None:
    harness = greeted(robot(), FINE_IDENT)
    window_m = 131 * 0.03048
    at_end = math.ceil(window_m / 172e-6)
    harness.odom(100_000)
    harness.send(Echo2(0, 110_000, 0, 0b11, 0, (at_end, at_end + 1)))
    harness.odom(120_000)
    (firing,) = harness.robot.take_received().firings
    assert firing.ranges_m[0] == at_end * (1e-6 * 172)
    assert math.isnan(firing.ranges_m[1])
    assert harness.robot.stamper.out_of_window.count == 1


def test_echo2_of_a_robot_that_speaks_version_1_is_ignored() -> None:
    harness = greeted(robot(), Ident(0, 1, 8, 100, 500, 20, 1, "old"))
    harness.odom(100_000)
    harness.send(Echo2(0, 105_000, 0, 1, 0, (900,)), Echo(0, 110_000, 0, 1, (30,)))
    harness.odom(120_000)
    (firing,) = harness.robot.take_received().firings
    assert firing.ranges_m[0] == pytest.approx(0.9144)


# The emulated robot.


def host(config: RobotConfig, world: WorldConfig = WALL) -> Host:
    return Host(DenningDevice(config, world, 1))


def test_a_fine_ring_answers_both_versions_and_reports_in_the_one_asked_for_last() -> None:
    h = host(robot())
    h.send(Pattern, 50, 100, (0b1,))
    h.send(Hello, 1)
    h.run(0.1)
    assert h.of(Ident) == [Ident(1, 1, 8, 100, 500, 20, h.robot.boot_id, "denning")]
    assert h.of(Echo)[0].tenths_ft == (round(1.9 / 0.03048),)
    assert h.of(Echo2) == []
    h.send(Hello, 2)
    h.run(0.1)
    last = h.last(Ident)
    assert (last.version, last.sensors, last.range_unit_um, last.capabilities) == (2, 8, 1000, 1)
    assert h.last(Echo2).counts == (1900,)
    h.send(Hello, 3)
    h.send(Hello, 0)
    h.run(0.01)
    assert [nak.code for nak in h.of(Nak)] == [NakCode.VALUE_OUT_OF_RANGE] * 2


@pytest.mark.parametrize(
    ("config", "version"),
    [
        (robot(24, 0.03048), 1),
        (robot(24, 0.0), 2),
        (robot(16, 0.03048), 2),
        (robot(24, 0.03048, protocol=2), 2),
        (robot(8, 0.001, protocol=1), 1),
    ],
)
def test_the_emulated_robot_speaks_the_version_that_its_file_names_or_needs(
    config: RobotConfig, version: int
) -> None:
    h = host(config)
    h.send(Hello, 2)
    h.run(0.01)
    assert bool(h.of(Ident)) is (version == 2)


def test_listen_is_obeyed_and_cleared_by_the_next_pattern() -> None:
    h = host(robot(beam_half_angle_deg=30.0))
    h.send(Hello, 2)
    h.send(Pattern, 50, 100, (0b1, 0b10))
    listen = h.send(Listen, (0b10, 0b0))
    h.run(0.3)
    assert listen in [ack.of for ack in h.of(Ack)]
    # Sensor 1 hears sensor 0's pulse from the wall: the image of sensor 0 behind the wall, seen from sensor 1.
    x, y = 0.1 * math.cos(math.pi / 4), 0.1 * math.sin(math.pi / 4)
    heard = [echo for echo in h.of(Echo2) if echo.heard]
    assert {(echo.step, echo.fired, echo.heard) for echo in heard} == {(0, 1, 2)}
    assert all(echo.counts[0] == 1900 for echo in heard)
    assert {echo.step for echo in h.of(Echo2)} == {0, 1}
    assert {echo.counts[1] for echo in heard} == {round(500 * math.hypot(4.0 - 0.1 - x, y))}
    h.send(Pattern, 50, 100, (0b1, 0b10))
    h.run(0.1)
    h.heard.clear()
    h.run(0.3)
    assert all(echo.heard == 0 for echo in h.of(Echo2))


def test_listen_that_does_not_fit_is_refused() -> None:
    h = host(robot())
    h.send(Listen, ())
    h.send(Hello, 2)
    h.send(Listen, (1,))
    h.send(Listen, ())
    h.send(Pattern, 50, 100, (0b1, 0b10))
    refused: tuple[tuple[int, ...], ...] = ((0b10,), (0b1, 0b1), (1 << 8, 0), (0b10, 0b1))
    for masks in refused:
        h.send(Listen, masks)
    h.run(0.01)
    unknown, out = NakCode.UNKNOWN_TYPE, NakCode.VALUE_OUT_OF_RANGE
    assert [(nak.of, nak.code) for nak in h.of(Nak)] == [(0, unknown), (2, out), (5, out), (6, out), (7, out)]
    assert {ack.of for ack in h.of(Ack)} == {3, 4, 8}


@pytest.mark.parametrize("count", [6, 16, 24])
def test_rings_of_any_size_drive_and_are_heard_to_a_millimetre(count: int) -> None:
    cable = Cable(config=robot(count, firing={"sets": [[0]], "rotations": count}))
    cable.plug()
    cable.run(1.5)
    assert cable.driver.state is LineState.READY
    assert cable.driver.problem is None
    assert len(cable.firings) >= 20
    ranges = np.array([firing.ranges_m for firing in cable.firings])
    counts = ranges[np.isfinite(ranges)] * 1e3
    assert len(counts) > 0
    np.testing.assert_allclose(counts, np.rint(counts), atol=1e-9)


def test_the_old_pattern_and_ring_still_speak_version_1() -> None:
    cable = Cable()
    cable.plug()
    cable.run(1.0)
    assert cable.driver.state is LineState.READY
    assert len(cable.firings) >= 15
    h = host(robot(24, 0.03048), WorldConfig(acoustics=AcousticsConfig()))
    h.send(Pattern, 50, 255, THIRDS)
    h.run(0.2)
    assert len(h.of(Echo)) >= 2
