"""The contract of drivers, with the real firmware as the robot: what a line and a board can do to it.

Left out are clauses on what no wheel with an encoder has, as a velocity that is never exceeded by a hair, or motors
that report a fault at rest; and the longest ones, which its emulated counterpart passes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import cast

import pytest

from config.world import WorldConfig
from drivers.contract import connecting, failing, measuring, motion
from drivers.contract.family import ROOM, Family, ring_with
from drivers.emulator.faults import Fault
from drivers.emulator.robot_device import RobotDevice
from drivers.messages import Flags
from drivers.registry import make_driver
from tests.drivers.cable import Cable
from tests.drivers.firmware.board import install
from tests.drivers.firmware.device import FirmwareDevice

Clause = Callable[[Family], None]
pytestmark = pytest.mark.compiled


@dataclass(frozen=True, slots=True, kw_only=True)
class FirmwareFamily(Family):
    """The family whose robots run the firmware, each in its own folder."""

    folder: Path
    devices: list[FirmwareDevice] = field(default_factory=list)

    def cable(self, *faults: Fault, world: WorldConfig = ROOM) -> Cable:
        family = self

        class FirmwareCable(Cable):
            def __post_init__(self) -> None:
                place = family.folder / str(len(family.devices))
                device = FirmwareDevice(place, self.config, self.world, 1, self.faults)
                family.devices.append(device)
                self.robot = cast("RobotDevice", device)
                self.driver = make_driver(self.config)

        return FirmwareCable(faults, self.robot, world=world, twist=None)


@pytest.fixture
def family(tmp_path: Path) -> Iterator[Family]:
    config = install(tmp_path / "shipped", "pico")
    other = ring_with(config.ring, sets=[[0, 6], [4, 10], [2, 5]], step_period_s=0.06)
    found = FirmwareFamily(
        config, other, connect_s=0.3, silent_s=0.5, deaf_s=0.5, halt_s=0.3, handshake_bytes=60, cut_stride=41,
        folder=tmp_path,
    )  # fmt: skip
    yield found
    for device in found.devices:
        device.close()


def unmeasured(_text: str) -> None:
    """Keep no figure."""


SHORT: tuple[Clause, ...] = (
    connecting.test_it_identifies_the_robot_sets_its_pattern_and_is_ready,
    failing.test_an_echo_comes_again_within_a_second_of_the_replug,
    failing.test_an_unplugged_line_costs_no_good_frame,
    measuring.test_firings_follow_the_pattern_and_their_times_grow,
    measuring.test_ranges_are_those_of_the_world_in_metres,
    motion.test_a_halt_stops_the_base_and_holds_it_until_a_release,
    partial(motion.test_the_base_stops_by_itself_when_the_host_is_gone, how="frozen"),
)
LONG: tuple[Clause, ...] = (
    connecting.test_any_bytes_are_survived_at_both_ends,
    partial(failing.test_noise_gives_no_false_range_and_the_line_recovers, kind="bit_errors", more={"rate": 2e-3}),
    partial(failing.test_a_restart_is_reported_and_measurements_begin_anew, off_s=0.1),
    connecting.test_an_unanswered_line_goes_down_with_a_reason_and_is_ready_once_the_robot_answers,
    *(partial(connecting.test_how_bytes_are_split_makes_no_difference, size=size) for size in (1, 7)),
    connecting.test_a_drive_before_ready_is_not_sent,
    *(partial(failing.test_cut_before_any_byte, way=way, measured=unmeasured) for way in failing.WAYS),
    *(
        partial(failing.test_a_robot_that_falls_silent_is_called_dead_and_comes_back, kind=kind, measured=unmeasured)
        for kind in ("mute", "deaf")
    ),
    partial(
        failing.test_noise_gives_no_false_range_and_the_line_recovers, kind="garbage", more={"bytes_per_s": 500.0}
    ),
    *(partial(failing.test_a_restart_is_reported_and_measurements_begin_anew, off_s=off_s) for off_s in (0.0, 1.0)),
    failing.test_a_robot_that_is_unplugged_by_its_own_fault_is_the_same_as_a_cut,
    measuring.test_the_pattern_changes_while_it_drives_and_an_impossible_one_leaves_it,
    measuring.test_firings_lie_on_the_way_that_was_driven,
    motion.test_nothing_moves_without_a_command,
    motion.test_it_drives_as_commanded_and_reports_it,
    motion.test_a_halt_goes_out_at_once_also_on_a_line_that_is_full,
    *(partial(motion.test_a_halt_is_kept_for_the_next_line_and_a_velocity_is_not, outage_s=s) for s in (0.005, 0.1)),
    motion.test_a_line_that_opens_again_moves_nothing_by_itself,
    partial(motion.test_the_base_stops_by_itself_when_the_host_is_gone, how="unplugged"),
    *(
        partial(motion.test_what_is_wrong_with_the_base_is_reported_and_over_when_it_is, kind=kind, flag=flag)
        for kind, flag in (("bumper", Flags.BUMPER), ("low_battery", Flags.BATTERY_LOW))
    ),
)


def name_of(clause: Clause) -> str:
    if isinstance(clause, partial):
        values = [str(value) for value in clause.keywords.values() if isinstance(value, str | float | int)]
        return "-".join((clause.func.__name__, *values))
    return clause.__name__


@pytest.mark.parametrize("clause", SHORT, ids=name_of)
def test_clause(clause: Clause, family: Family) -> None:
    clause(family)


@pytest.mark.soak
@pytest.mark.parametrize("clause", LONG, ids=name_of)
def test_long_clause(clause: Clause, family: Family) -> None:
    clause(family)
