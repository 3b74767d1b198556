"""Ids of sonars, firing patterns that the controller can carry out, and velocities without ESC."""

from __future__ import annotations

import pytest

from config.load import load_robot
from drivers.contract.family import ring_with
from drivers.driver import DriverError
from drivers.firing_pattern import FiringError
from drivers.messages import Twist
from drivers.rflex.codec import direction_of
from drivers.rflex.wire_units import (
    SonarPattern,
    drive_commands,
    pattern_of,
    sonar_ids,
    stop_commands,
    without_escape,
)

B21R = load_robot("b21r")


def test_ids_go_bank_by_bank() -> None:
    assert sonar_ids(B21R)[:9] == (0, 1, 2, 3, 16, 17, 18, 19, 32)
    assert sonar_ids(load_robot("b21r-base"))[:4] == (96, 97, 98, 112)
    assert sonar_ids(load_robot("atrvjr"))[4:7] == (4, 16, 17)


@pytest.mark.parametrize("wrong", [{"banks": (4, 4)}, {"first_bank": 11}])
def test_banks_that_do_not_fit_are_refused(wrong: dict[str, object]) -> None:
    config = B21R.model_copy(update={"rflex": B21R.rflex.model_copy(update=wrong)})
    with pytest.raises(DriverError, match=r"rflex\.banks"):
        sonar_ids(config)


def test_the_controller_fires_one_sonar_of_each_bank() -> None:
    assert pattern_of(B21R, B21R.ring) == SonarPattern(30_000, 0, 5.1)
    magellan = load_robot("magellan")
    assert pattern_of(magellan, magellan.ring).ping_us == 1250
    with pytest.raises(FiringError, match="fires by itself"):
        pattern_of(B21R, ring_with(B21R.ring, preset="octets", step_period_s=0.05))
    slow = magellan.model_copy(update={"rflex": magellan.rflex.model_copy(update={"ping_delay_us": 50_000})})
    with pytest.raises(FiringError, match="ping delay"):
        pattern_of(slow, slow.ring)


@pytest.mark.parametrize(
    ("speed", "sent"),
    [(0, 0), (26, 26), (27, 26), (0x1B00, 0x1AFF), (-0x1B90, -0x1AFF), (0x051B, 0x051A)],
)
def test_no_byte_of_a_speed_is_escape(speed: int, sent: int) -> None:
    assert without_escape(speed) == sent


def test_velocities_are_clamped_and_a_translation_is_never_zero() -> None:
    v, w = drive_commands(Twist(0.3, -0.5), B21R)
    assert direction_of(v) == (0, 30369, 50615)
    assert direction_of(w)[:2] == (1, -17672)
    v, w = drive_commands(Twist(1e300, -1e300), B21R)
    assert direction_of(v)[1] == 50615
    assert direction_of(w)[1] == -35343
    assert direction_of(drive_commands(Twist(0.0, 0.1), B21R)[0])[1] == 1
    v, w = stop_commands(B21R, 0)
    assert direction_of(v) == (0, 0, 202460)
    assert direction_of(w)[1] == 0
