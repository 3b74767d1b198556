"""`echolocate init plugin`: a package of one's own for a robot that speaks lines, or for a schema."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Final

from config.errors import DONE, FAILED, WRONG_CALL, UserError
from config.files import list_shipped
from config.plugins import SCHEMAS, plugged
from config.schema_use import SHIPPED_USES
from drivers.registry import known_drivers

NAME: Final = re.compile(r"[a-z][a-z0-9_]{1,39}")
PROJECT: Final = """[build-system]
requires = ["setuptools>=77"]
build-backend = "setuptools.build_meta"
[project]
name = "echolocate-plugin-{name}"
version = "0.1"
dependencies = ["echolocate"]
"""
ROBOT_PROJECT: Final = (
    PROJECT
    + """
[project.entry-points."echolocate.drivers"]
{name} = "{name}"

[project.entry-points."echolocate.robots"]
{name} = "{name}.robots"

[tool.setuptools]
package-dir = {{ "" = "." }}  # installed with -e, it is found also beside this folder
packages = ["{name}"]
package-data = {{ {name} = ["robots/*.toml"] }}
"""
)
SCHEMA_PROJECT: Final = (
    PROJECT
    + """
[project.entry-points."echolocate.schemas"]
{name} = "{name}:Schema"

[tool.setuptools]
package-dir = {{ "" = "." }}  # installed with -e, it is found also beside this folder
py-modules = ["{name}"]
"""
)
ROBOT: Final = '''"""{name}: a robot that speaks lines of JSON. Change `Lines` to what yours says."""

import json
import math

from config.strict import Strict
from drivers.firing_pattern import FiringPattern
from drivers.lines.device import LineDevice
from drivers.lines.driver import LineDriver
from drivers.lines.wire import Ranges, Sample, Wire
from drivers.messages import Pose, Twist
from pydantic import Field

HAS = ("deadman", "stamps", "restart", "pattern")  # of drivers/capabilities.py; `echolocate check` says what lacks


class Config(Strict):
    """The table `[{name}]` of a robot file."""

    report_s: float = Field(default=0.05, ge=0.01, le=1.0)
    """Time from one line of the odometry to the next, s."""


class Lines(Wire):
    name = "{name}"
    deadman_s = 0.5  # s without a velocity after which the base stops by itself; None if it never does

    def __init__(self, config):
        self.period_s = config.own_table("{name}", Config).report_s

    def velocity(self, twist):  # to the robot
        return line(v=twist.v, w=twist.w)

    def pattern(self, pattern):
        return line(fire=pattern.masks, every=pattern.step_period_s, to=pattern.window_m)

    def read(self, text):  # from the robot
        said = json.loads(text)
        if "r" in said:
            return Ranges({{int(k): math.inf if r is None else r for k, r in said["r"].items()}}, said["t"])
        return Sample(Pose(*said["at"]), Twist(*said["does"]), said["t"])

    def heard(self, text):  # the same two the other way, for the emulated robot
        asked = json.loads(text)
        if "fire" in asked:
            return FiringPattern(tuple(asked["fire"]), asked["every"], asked["to"])
        return Twist(asked["v"], asked["w"])

    def say(self, said):
        if isinstance(said, Ranges):
            return line(t=said.robot_s, r={{k: r if math.isfinite(r) else None for k, r in said.ranges_m.items()}})
        pose, twist = said.pose, said.twist
        return line(t=said.robot_s, at=(pose.x, pose.y, pose.theta), does=(twist.v, twist.w))


def line(**fields):
    return json.dumps(fields, separators=(",", ":")).encode() + b"\\n"


def make_driver(config):
    return LineDriver(config, Lines(config))


def make_device(config, world, seed, *, faults, clock_start_us):
    return LineDevice(config, world, seed, faults, Lines(config))
'''
ROBOT_FILE: Final = """# {name}: measure yours, and change every number. `echolocate settings` lists every key.
robot.driver = "{name}"
link.deadman_max_s = 0.5  # that of the lines
[ring]
count = 12
radius_m = 0.12
beam_half_angle_deg = 15.0
resolution_m = 0.001
range_min_m = 0.05
range_max_m = 4.0
firing = {{ preset = "thirds", step_period_s = 0.05 }}
[body]
radius_m = 0.15
speed_max_m_s = 0.4
turn_max_rad_s = 1.5
acceleration_max_m_s2 = 0.5
"""
SCHEMA: Final = '''"""{name}: a motor schema. Change `answer` to what yours does."""

import math
from typing import ClassVar, Literal

from behaviors.response import Response
from behaviors.schema_call import Answer
from config.mission_step import Use
from pydantic import Field


class Schema(Use):
    """`{name}`: drives a way from where the step begins, in any direction that is free; arrives after it."""

    can_arrive: ClassVar[bool] = True  # False: a step with it needs `until`
    name: Literal["{name}"]
    """Of the schema."""
    way_m: float = Field(default=1.0, gt=0.0, le=100.0)
    """That way, m."""

    def answer(self, scene, memory):  # pure: what it keeps for the next cycle is the memory that it returns
        pose, start = scene.percept.pose, scene.start
        rest_m = max(0.0, self.way_m - math.hypot(pose.x - start.x, pose.y - start.y))
        length = 1.0 if rest_m else 0.0  # 1 asks for the base velocity
        vector = Response("{name}", length * math.cos(pose.theta), length * math.sin(pose.theta))
        return Answer(vector, memory, has_arrived=rest_m == 0.0, remaining_m=rest_m)
'''
FILES: Final[Mapping[str, Mapping[str, str]]] = MappingProxyType(
    {
        "robot": {
            "pyproject.toml": ROBOT_PROJECT,
            "{name}/__init__.py": ROBOT,
            "{name}/robots/{name}.toml": ROBOT_FILE,
        },
        "schema": {"pyproject.toml": SCHEMA_PROJECT, "{name}.py": SCHEMA},
    }
)
NEXT: Final[Mapping[str, str]] = MappingProxyType(
    {
        "robot": "pip install -e {folder} && echolocate run --robot {name}; its contract, with "
        "'pip install pytest': pytest --echolocate-family {name}",
        "schema": 'pip install -e {folder}; then name = "{name}" in a step of a mission (echolocate settings {name})',
    }
)


def write_plugin(name: str, kind: str) -> int:
    """Write a package into a new folder of the working directory, and return the exit code.

    Parameters
    ----------
    name
        Of the robot or the schema, of the package and of the folder.
    kind
        A name of `FILES`.

    Raises
    ------
    UserError
        The name is taken or is no name, or the folder exists.
    """
    if NAME.fullmatch(name) is None:
        raise UserError(
            f"{name!r}: give a name of small letters, digits and _, which begins with a letter", WRONG_CALL
        )
    taken = {*known_drivers(), *list_shipped("robots")} if kind == "robot" else {*SHIPPED_USES, *plugged(SCHEMAS)}
    if name in taken:
        raise UserError(f"{name}: is taken; choose another name than {', '.join(sorted(taken))}", WRONG_CALL)
    # Not importlib's own search: for that a module that was imported before is there, wherever it came from.
    if any(finder.find_spec(name, None) for finder in sys.meta_path):
        raise UserError(f"{name}: a module of this name is here already; choose another name", WRONG_CALL)
    folder = Path(name)
    try:
        folder.mkdir()
        for path, text in FILES[kind].items():
            file = folder / path.format(name=name)
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text.format(name=name), encoding="utf-8")
            sys.stdout.write(f"{file}: written\n")
    except FileExistsError as error:
        raise UserError(f"{folder}: exists already; choose another name, or another folder", WRONG_CALL) from error
    except OSError as error:
        raise UserError(f"{folder}: cannot be written: {error.strerror}; choose another folder", FAILED) from error
    sys.stdout.write(f"next: {NEXT[kind].format(name=name, folder=f'./{folder}')}\n")
    return DONE
