"""The robots on which the contract of drivers is tested: one of each family, and what the contract leaves open."""

from __future__ import annotations

from importlib.metadata import EntryPoint
from types import MappingProxyType
from typing import Final

from config.load import load_robot
from config.robot import BodyConfig, DriverConfig, LinkConfig, RingConfig, RobotConfig
from drivers.contract.family import Family, ring_with
from drivers.registry import GROUP
from tests.drivers.cable import ROBOT

DENNING: Final = Family(
    ROBOT, ring_with(ROBOT.ring, preset="quadrants", step_period_s=0.06), connect_s=0.2, silent_s=0.5, deaf_s=0.5,
    halt_s=0.15, handshake_bytes=60, cut_stride=7,
)  # fmt: skip
P3DX: Final = load_robot("p3dx")
ARCOS: Final = Family(
    P3DX, ring_with(P3DX.ring, sets=[[k, 15 - k] for k in (3, 4, 0, 7)], step_period_s=0.06), connect_s=1.5,
    silent_s=0.65, deaf_s=1.6, halt_s=0.3, volts=(12.6, 10.7),
)  # fmt: skip
B21R: Final = load_robot("b21r")
RFLEX: Final = Family(
    B21R, B21R.ring.model_copy(update={"firing": B21R.ring.firing.model_copy(update={"step_period_s": 0.04})}),
    connect_s=0.4, silent_s=0.5, deaf_s=1.0, halt_s=0.35, volts=(25.2, 20.0),
)  # fmt: skip
ROS2: Final = Family(
    DENNING.robot.model_copy(update={
        "robot": DriverConfig(driver="ros2"), "body": DENNING.robot.body.model_copy(update={"synchro": False}),
    }),
    DENNING.other_ring, connect_s=0.2, silent_s=0.5, deaf_s=0.5, halt_s=0.15,
)  # fmt: skip
"""Without ROS, which tests/drivers/ros2 adds in plain data."""
SERVO1_FILE: Final = load_robot("servo1")
SERVO1_RING: Final = ring_with(
    SERVO1_FILE.ring.model_copy(update={"range_max_m": 4.0}), preset="single", step_period_s=0.024
)
SERVO1: Final = Family(
    SERVO1_FILE.model_copy(update={"ring": SERVO1_RING, "body": ROBOT.body.model_copy(update={"synchro": False})}),
    ring_with(SERVO1_RING, preset="single", step_period_s=0.03), connect_s=0.2, silent_s=0.5, deaf_s=0.5, halt_s=0.15,
    handshake_bytes=80, cut_stride=29,
)  # fmt: skip
"""A sensor on a servo, which sees the whole room."""
CHIRP_RING: Final = RingConfig.model_validate({
    "count": 12, "radius_m": 0.2, "beam_half_angle_deg": 15.0, "resolution_m": 0.001, "range_min_m": 0.05,
    "range_max_m": 4.0, "firing": {"preset": "thirds", "step_period_s": 0.05},
})  # fmt: skip
CHIRP: Final = Family(
    RobotConfig(
        robot=DriverConfig(driver="chirp"), ring=CHIRP_RING,
        body=BodyConfig(radius_m=0.2, speed_max_m_s=0.6, turn_max_rad_s=1.5), link=LinkConfig(port="/dev/chirp"),
    ),
    ring_with(CHIRP_RING, preset="quadrants", step_period_s=0.06), connect_s=0.3, silent_s=0.5, deaf_s=0.5,
    halt_s=0.15,
)  # fmt: skip
"""The example of docs/extending.md."""
CHIRP_ENTRY: Final = EntryPoint("chirp", "tests.drivers.contract.example.family", GROUP)
FAMILIES: Final = MappingProxyType(
    {"arcos": ARCOS, "chirp": CHIRP, "denning": DENNING, "rflex": RFLEX, "ros2": ROS2, "servo1": SERVO1}
)
