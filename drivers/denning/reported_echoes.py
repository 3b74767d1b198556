"""The emulated ring's echo frames: what its sensors report of one firing, in either version of the protocol."""

from __future__ import annotations

import numpy as np

from config.robot import RingConfig
from drivers.denning.frames import Echo, Echo2
from drivers.denning.pattern_rotation import Step
from drivers.denning.wire_units import echo_byte, echo_count, range_unit_um
from drivers.emulator.fault_schedule import FaultSchedule
from drivers.emulator.faulty_sonar import FaultySonar
from drivers.emulator.sonar import Sonar
from drivers.firing_pattern import sensors
from drivers.messages import Pose


class EchoReporter:
    """Fires the ring's sensors and reports what they hear, faults of sensors included.

    Parameters
    ----------
    ring
        The ring.
    sonar
        Its electronics.
    faults
        What is wrong with the robot at present.
    rng
        Random numbers of their faults.

    Attributes
    ----------
    unit_um
        What a count of ECHO2 stands for, µm.
    """

    def __init__(self, ring: RingConfig, sonar: Sonar, faults: FaultSchedule, rng: np.random.Generator) -> None:
        self.unit_um = range_unit_um(ring)
        self._sonar = FaultySonar(sonar, len(ring.mounts), faults, rng)

    def fire(self, step: Step, t_us: int, pose: Pose, ring_yaw: float, version: int) -> Echo | Echo2:
        """Return the frame of one firing at `t_us` of the robot's clock; listeners report in version 2 only."""
        fired, heard = sensors(step.mask), sensors(step.listeners) if version > 1 else ()
        reported = self._sonar.fire(step.at_us, pose, ring_yaw, fired, step.window_m, heard)
        if version == 1:
            return Echo(0, t_us, step.number, step.mask, tuple(map(echo_byte, reported)))
        counts = tuple(echo_count(range_m, self.unit_um) for range_m in reported)
        return Echo2(0, t_us, step.number, step.mask, step.listeners, counts)
