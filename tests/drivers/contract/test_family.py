"""A family of a robot that its file alone describes: its times and speeds follow from the file."""

from __future__ import annotations

import pytest

from config.load import load_robot
from config.world import WorldConfig
from drivers.base_model import stop_s
from drivers.contract.family import family_of, find_family
from drivers.emulator import body as emulator_body
from drivers.messages import Twist
from tests.drivers.contract.families import CHIRP


def test_a_slower_robot_drives_slower_and_may_take_as_much_longer() -> None:
    quick = load_robot("denning")
    body = quick.body.model_copy(update={"speed_max_m_s": 0.25, "acceleration_max_m_s2": 0.1})
    slow = family_of(quick.model_copy(update={"body": body}))
    assert family_of(quick).at(0.3, 0.4) == Twist(0.3, 0.4)
    assert slow.at(0.3, 0.4) == Twist(0.15, 0.2)
    assert slow.halt_s >= stop_s(slow.ahead, body)
    assert family_of(quick, halt_s=0.1).halt_s == 0.1


def test_it_is_found_by_a_robots_name_or_in_a_module() -> None:
    assert find_family("p3dx").robot == load_robot("p3dx")
    assert find_family("tests.drivers.contract.families:CHIRP") is CHIRP
    with pytest.raises(TypeError, match="expected a"):
        find_family("tests.drivers.contract.families:CHIRP_RING")
    with pytest.raises(AttributeError):
        find_family("tests.drivers.contract.families:NONE")


@pytest.mark.parametrize("name", ["denning", "p3dx", "b21r"])
@pytest.mark.parametrize("deceleration_m_s2", [0.2, 0.6, 3.0])
def test_a_base_that_brakes_as_its_file_says_is_not_called_failed(
    monkeypatch: pytest.MonkeyPatch, name: str, deceleration_m_s2: float
) -> None:
    def no_harder(speed: float, target: float, rate: float, dt_s: float) -> tuple[float, float]:
        return approach(speed, target, min(rate, deceleration_m_s2), dt_s)

    approach = emulator_body._approach
    monkeypatch.setattr("drivers.emulator.body._approach", no_harder)
    robot = load_robot(name)
    body = robot.body.model_copy(update={"acceleration_max_m_s2": deceleration_m_s2, "speed_max_m_s": 1.5})
    family = family_of(robot.model_copy(update={"body": body}))
    fastest = Twist(body.speed_max_m_s, 0.0)
    cable = family.driving(fastest, world=WorldConfig())
    cable.driver.halt()
    until_s, problems = cable.now_s + stop_s(fastest, body) + 0.5, set[str | None]()
    while cable.now_s < until_s:
        cable.step()
        problems.add(cable.driver.problem)
    assert cable.robot.truth.twist.v == pytest.approx(0.0, abs=1e-4)
    assert problems == {None}
