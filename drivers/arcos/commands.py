"""The commands to a robot of the Pioneer family: their numbers and arguments."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum


class CommandNumber(IntEnum):
    """The numbers of commands; SYNC0 to SYNC2 share theirs with PULSE, OPEN and CLOSE."""

    PULSE = 0
    OPEN = 1
    CLOSE = 2
    POLLING = 3
    ENABLE = 4
    SETA = 5
    SETV = 6
    SETO = 7
    MOVE = 8
    ROTATE = 9
    SETRV = 10
    VEL = 11
    HEAD = 12
    DHEAD = 13
    SAY = 15
    JOYINFO = 17
    CONFIG = 18
    ENCODER = 19
    SETRVDIR = 20
    RVEL = 21
    DCHEAD = 22
    SETRA = 23
    IMU = 26
    SONAR = 28
    STOP = 29
    DIGOUT = 30
    POWER_PORT = 31
    VEL2 = 32
    GRIPPER = 33
    ADSEL = 35
    GRIPPERVAL = 36
    GRIPPERPACREQUEST = 37
    IOREQUEST = 40
    PTUPOS = 41
    TTY2 = 42
    GETAUX = 43
    BUMPSTALL = 44
    TCM2 = 45
    JOYDRIVE = 47
    SONARCYCLE = 48
    HOSTBAUD = 50
    AUX1BAUD = 51
    AUX2BAUD = 52
    AUX3BAUD = 53
    ESTOP = 55
    E_STALL = 56
    GYRO = 58
    TTY4 = 60
    GETAUX3 = 61
    BATTERYINFO = 62
    TTY3 = 66
    GETAUX2 = 67
    CHARGE = 68
    ROTKP = 82
    ROTKV = 83
    ROTKI = 84
    TRANSKP = 85
    TRANSKV = 86
    TRANSKI = 87
    REVCOUNT = 88
    DRIFTFACTOR = 89
    SOUND = 90
    PLAYLIST = 91
    SOUNDTOG = 92
    TICKSMM = 93
    POWER_PC = 95
    POWER_LRF = 96
    POWER_5V = 97
    POWER_12V = 98
    LATVEL = 110
    LATACCEL = 113
    BATTEST = 250
    RESET = 253
    MAINTENANCE = 255


@dataclass(frozen=True, slots=True)
class Raw:
    """An argument of a form that none of the protocol's three has, verbatim: the bytes after the command's number."""

    data: bytes


@dataclass(frozen=True, slots=True)
class Command:
    """A command to the robot."""

    number: int
    """Its number, one of `CommandNumber` or unknown."""
    argument: int | bytes | Raw | None = None
    """None, an integer of -65535 to 65535, a byte string, or the bytes of any other form."""

    @property
    def value(self) -> int:
        """The argument as an integer, read as the firmware does: 0 if there is none."""
        match self.argument:
            case int(value):
                return value
            case Raw(data) if data and data[0] in (0x3B, 0x1B):
                magnitude = int.from_bytes(data[1:3], "little")
                return -magnitude if data[0] == 0x1B else magnitude
            case _:
                return 0

    @property
    def two_bytes(self) -> tuple[int, int]:
        """High and low byte of an argument that packs two, as in VEL2; some clients send it negated and signed."""
        high, low = divmod(self.value & 0xFFFF, 0x100)
        return high, low
