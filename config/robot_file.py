"""The text of a robot file of one's own, with comments: what `echolocate init robot` and the console's form write."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Final

from config.robot import BY_HAND_MAX, SOUND_SPEED_M_S

ARRAY: Final = 8
"""Sensors of an array of a Pioneer, and of a bank that is written for an rFLEX controller; of each, one fires."""
BAUD: Final = 115200
ARCOS_BAUD: Final = 38400
ARCOS_LINK: Final = """reply_timeout_s = 0.25
tries = 2
silence_max_s = 0.5  # the controller reports every 0.1 s
deadman_max_s = 2.0  # its watchdog as delivered; less in the robot's flash is better
"""


@dataclass(frozen=True, slots=True)
class RobotDraft:
    """A robot as a person describes it: m, degrees, s. Nothing is checked here."""

    name: str
    driver: str
    count: int | None
    radius_m: float | None
    """Of a regular ring."""
    sensors: tuple[tuple[float, float, float], ...] | None
    """x, y and direction of each sensor, in place of count and radius."""
    beam_half_angle_deg: float
    resolution_m: float
    range_min_m: float
    range_max_m: float
    preset: str
    step_period_s: float
    body_radius_m: float
    speed_max_m_s: float
    turn_max_rad_s: float
    synchro: bool
    baud: int | None = None
    """None for what such robots usually have."""
    port: str = ""


def robot_text(draft: RobotDraft) -> str:
    """Return the robot file of a draft as TOML."""
    name = f"name = {_quoted(draft.name)}\n" if draft.name else ""
    port = "ros2" if draft.driver == "ros2" else draft.port
    baud = (ARCOS_BAUD if draft.driver == "arcos" else BAUD) if draft.baud is None else draft.baud
    return f"""# A robot of your own. `echolocate settings` lists every key; `echolocate check FILE` checks a file.

[robot]
{name}driver = {_quoted(draft.driver)}
{_own_section(draft)}
[ring]
{_mounting(draft)}
beam_half_angle_deg = {draft.beam_half_angle_deg:g}
resolution_m = {draft.resolution_m:g}  # step of the reported ranges; 0 = none
range_min_m = {draft.range_min_m:g}
range_max_m = {draft.range_max_m:g}

[ring.firing]
preset = {_quoted(draft.preset)}  # how many sensors fire at a time
step_period_s = {draft.step_period_s:g}  # sound needs {2.0 * draft.range_max_m / SOUND_SPEED_M_S:.4f} s to range_max_m and back

[body]
radius_m = {draft.body_radius_m:g}
speed_max_m_s = {draft.speed_max_m_s:g}
turn_max_rad_s = {draft.turn_max_rad_s:g}
synchro = {str(draft.synchro).lower()}  # true: the wheels turn, body and ring do not
{start_turn(_count(draft)) if draft.driver == "denning" and not draft.synchro else ""}
[link]
{f"port = {_quoted(port)}" if port else '# port = "/dev/ttyUSB0"  # or name it at the start: echolocate run --port'}
baud = {baud}
{ARCOS_LINK if draft.driver == "arcos" else ""}"""  # noqa: E501 - the file's own lines


def start_turn(sensors: int) -> str:
    """Return the line of a body whose sensors are wired by hand; none where a turn on the spot would show nothing."""
    if not 2 <= sensors <= BY_HAND_MAX:
        return ""
    return "turns_at_start = true  # once, on the spot: a sensor that is deaf, exchanged or backwards shows then\n"


def _mounting(draft: RobotDraft) -> str:
    if draft.sensors is not None:
        rows = "".join(f"  {{ x_m = {x:g}, y_m = {y:g}, angle_deg = {angle:g} }},\n" for x, y, angle in draft.sensors)
        return f"sensors = [  # x ahead, y to the left, degrees counter-clockwise from ahead\n{rows}]"
    return (
        f"count = {draft.count}  # sensor 0 looks forward, the others follow counter-clockwise; or list them as "
        f"sensors = [...]\nradius_m = {0.0 if draft.radius_m is None else draft.radius_m:g}"
    )


def _count(draft: RobotDraft) -> int:
    return len(draft.sensors) if draft.sensors is not None else draft.count or 0


def _own_section(draft: RobotDraft) -> str:
    """Return the section of the driver's own, with values to be measured."""
    count = _count(draft)
    match draft.driver:
        case "arcos":
            return (
                "\n[arcos]  # mm and rad from the controller's counts: `echolocate calibrate` finds them\n"
                "distance_factor = 1.0\nturn_factor = 0.0056\n"
            )
        case "rflex":
            return (
                "\n[rflex]  # the controller's counts per metre and radian: `echolocate calibrate` finds them\n"
                f"distance_factor = 101230.0\nangle_factor = 35343.888\nbanks = {[ARRAY] * (count // ARRAY)}\n"
            )
        case "ros2":
            frames = json.dumps([f"sonar_{k}" for k in range(count)])
            return (
                "\n[ros2]  # topics and frames: `echolocate ros2-robot` finds them\n"
                f'ranges = ["sonar"]\nframes = {frames}\nodometry = "odom"\ncmd_vel = "cmd_vel"\n'
            )
    return ""


def _quoted(text: str) -> str:
    """Return a text as TOML has it, which is as JSON has it."""
    return json.dumps(text, ensure_ascii=False)
