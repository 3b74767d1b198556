"""The section of the rFLEX family: defaults, bounds, and the shipped files' factors and banks."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from config.families.rflex import RflexConfig
from config.load import load_robot


@pytest.mark.parametrize("value", [{"banks": ()}, {"banks": (17,)}, {"distance_factor": 0.0}, {"factor": 1.0}])
def test_bounds(value: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        RflexConfig(**value)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "banks", "distance", "angle", "range_factor", "first_deg"),
    [
        ("b21r", (4,) * 6, 101230.0, 35343.888, 1476.0, 172.5),
        ("b21r-both", (4,) * 6 + (3,) * 8, 101230.0, 35343.888, 1476.0, 172.5),
        ("b21r-base", (3,) * 8, 101230.0, 35343.888, 1476.0, -120.0),
        ("atrvjr", (5, 8, 5, 8), 87462.73, 36277.67, 1476.0, -150.0),
        ("magellan", (8, 8), 44509.7, 5818.0204, 1474.0, -112.5),
    ],
)
def test_the_shipped_robots(
    name: str, banks: tuple[int, ...], distance: float, angle: float, range_factor: float, first_deg: float
) -> None:
    robot = load_robot(name)
    rflex = robot.rflex
    assert robot.robot.driver == "rflex"
    assert (rflex.banks, rflex.distance_factor, rflex.angle_factor) == (banks, distance, angle)
    assert rflex.range_factor == range_factor
    assert len(robot.ring.mounts) == sum(banks)
    assert robot.ring.mounts[0].angle_rad * 180.0 / 3.141592653589793 == pytest.approx(first_deg)
    assert robot.body.synchro == (name in {"b21r-base", "b21r-both"})


def test_both_rings_of_a_b21r_are_its_two_rings_and_only_the_upper_one_turns_with_the_wheels() -> None:
    upper, base, both = (load_robot(name) for name in ("b21r", "b21r-base", "b21r-both"))
    assert both.ring.mounts == upper.ring.mounts + base.ring.mounts
    assert both.ring.turning == tuple(range(24))
    assert (upper.ring.turning, base.ring.turning) == ((), ())
    assert both.body == base.body
