"""What the firmware of an emulated Pioneer has in its flash memory, and the factors of its units."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.arcos.frames import BAUDS, ConfigPacket


@dataclass(frozen=True, slots=True)
class Firmware:
    """One robot's names, factors and flash settings."""

    subclass: str
    """The model, in lower case, by which clients find their parameters."""
    mm_per_count: float
    """Odometry, mm of a raw unit."""
    mm_s_per_count: float
    """Speed of a wheel, mm/s of a raw unit."""
    mm_per_range: float
    """Range, mm of a raw unit."""
    rad_s_per_mm_s: float
    """Turning rate, rad/s, of half the difference of the wheels' speeds, mm/s."""
    sensor_numbers: tuple[int, ...]
    """Number of each sensor of the ring in SIPs and POLLING, counted from 0."""
    vel2_mm_s: int = 20
    """Speed of a unit of VEL2, mm/s."""
    front_bumpers: int = 5
    rear_bumpers: int = 5
    """Number of their segments."""
    speed_top_mm_s: int = 2200
    turn_top_deg_s: int = 500
    """Absolute limits, mm/s and degrees/s."""
    baud: int = 9600
    """Speed of the line after a reset and after CLOSE."""
    name: str = "echolocate"
    class_name: str = "Pioneer"
    serial: str = "EMULATED"
    """As in the answer to SYNC2 and in the CONFIGpac."""
    sip_cycle_ms: int = 100
    sonar_cycle_ms: int = 40
    watchdog_ms: int = 2000
    """Periods, ms."""
    acceleration_mm_s2: int = 300
    turn_acceleration_deg_s2: int = 100
    """Ramps until SETA and SETRA change them, up and down alike."""
    acceleration_top_mm_s2: int = 4000
    turn_acceleration_top_deg_s2: int = 600
    """Their limits; ESTOP brakes with them."""

    def config_packet(self, speed_mm_s: int, turn_deg_s: int, watchdog_ms: int, ramps: RampSettings) -> ConfigPacket:
        """Return the CONFIGpac."""
        numbers = self.sensor_numbers
        return ConfigPacket(
            self.class_name,
            self.subclass,
            self.serial,
            four_motors=int(self.subclass.startswith(("p3at", "p2at"))),
            turn_top=self.turn_top_deg_s,
            speed_top=self.speed_top_mm_s,
            turn_acceleration_top=self.turn_acceleration_top_deg_s2,
            acceleration_top=self.acceleration_top_mm_s2,
            pwm_max=400,
            name=self.name,
            sip_cycle_ms=self.sip_cycle_ms,
            host_baud=baud_code(self.baud),
            aux1_baud=0,
            gripper=0,
            front_sonar=1,
            rear_sonar=int(any(number >= 8 for number in numbers)),
            low_battery=110,
            rev_count=16570,
            watchdog_ms=watchdog_ms,
            alternate_sip=0,
            stall_value=200,
            stall_count=200,
            joystick_speed=800,
            joystick_turn=50,
            turn_max=turn_deg_s,
            speed_max=speed_mm_s,
            turn_acceleration=ramps.turn_up,
            turn_deceleration=ramps.turn_down,
            turn_kp=40,
            turn_kv=20,
            turn_ki=0,
            acceleration=ramps.up,
            deceleration=ramps.down,
            speed_kp=40,
            speed_kv=30,
            speed_ki=0,
            front_bumpers=self.front_bumpers,
            rear_bumpers=self.rear_bumpers,
            charger=0,
            sonar_cycle_ms=self.sonar_cycle_ms,
            auto_baud=2,
            has_gyro=0,
            drift_factor=0,
            aux2_baud=0,
            aux3_baud=0,
            ticks_mm=138,
            shutdown_volts=105,
            firmware="2.9",
            gyro_cw=0,
            gyro_ccw=0,
            kinematics_delay_ms=0,
            lateral_top=0,
            lateral_acceleration_top=0,
            lateral_max=0,
            lateral_acceleration=0,
            lateral_deceleration=0,
            charge_threshold=0,
        )


@dataclass(frozen=True, slots=True)
class RampSettings:
    """Accelerations as SETA and SETRA set them, mm/s² and degrees/s²."""

    up: int
    down: int
    turn_up: int
    turn_down: int


def baud_code(baud: int) -> int:
    """Return the code of a line speed, that of 9600 for one that has none."""
    return BAUDS.index(baud) if baud in BAUDS else 0
