"""`echolocate init`: first files of one's own, from options and answers; they pass `echolocate check`."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Final

import orjson

from config.errors import DONE, WRONG_CALL, UserError
from config.files import names_a_path
from config.load import list_shipped, load_any, load_model, load_world
from config.robot import SENSORS_MAX
from config.robot_file import ARCOS_BAUD, ARRAY, BAUD, RobotDraft, robot_text
from config.settings import Settings
from drivers.firing_pattern import FiringError, time_of_flight_s
from drivers.registry import driver_names
from runtime.cli.commands.init_ring import Described, ask_mounting
from runtime.cli.commands.output_files import check_outputs, writing
from runtime.cli.commands.questions import Given, Questions
from runtime.support.config_lint import lint_settings
from runtime.support.pattern_check import refuse_undrivable

AT_A_TIME: Final = ((8, "octets"), (4, "quadrants"), (3, "thirds"), (2, "opposite_pairs"), (1, "single"))
PROTOCOLS: Final = (
    "  denning: a board of one's own, Pico or ESP32, with the files of `echolocate firmware`\n"
    "  arcos: a Pioneer or its relatives; rflex: a B21r or ATRV-Jr; ros2: topics of ROS 2"
)
CORNERS: Final = 16
"""Of the outline of a round model."""


def write_robot(file: str, given: Given, *, yes: bool, force: bool) -> int:
    """Write a robot file and return the exit code.

    Parameters
    ----------
    file, given, yes, force
        As of `runtime.cli.commands.init.robot`.
    """
    ask = _questions(file, given, yes=yes, force=force)
    while True:
        try:
            draft = _robot_draft(file, ask)
            ask.refuse_unused("--layout, --sensors or --driver")
            return _write(file, robot_text(draft), force=force)
        except UserError as error:
            if not ask.asks:
                raise
            ask.again(str(error))


def _robot_draft(file: str, ask: Questions) -> RobotDraft:
    """Return the robot as options and answers describe it."""
    ask.say(PROTOCOLS)
    driver = ask.choice("driver", "The robot's protocol", driver_names())
    name = ask.text("name", "What the robot is called", Path(file).stem)
    most = {"denning": 24, "arcos": 32, "rflex": 64, "ros2": 24}.get(driver, SENSORS_MAX)
    body = ask.number("body_radius", "Radius of the body, m", 0.3, 0.01, 10.0)
    beam = ask.number("beam_half_angle", "Half the width of a beam, degrees", 12.0, 0.5, 80.0)
    mounting = ask_mounting(ask, Described(body, beam, most, 16 if driver != "denning" else 24))
    sensors = len(mounting.sensors or ()) or mounting.count or 0
    if driver in {"arcos", "rflex"} and sensors % ARRAY:
        raise UserError(
            f"--sensors {sensors}: the driver {driver} has arrays of {ARRAY}: give {ARRAY}, {2 * ARRAY} "
            f"or another multiple, and describe a smaller array in the file",
            WRONG_CALL,
        )
    low = ask.number("range_min", "Least range of a sensor, m", 0.15, 0.0, 50.0)
    high = ask.number("range_max", "Greatest range of a sensor, m", 5.0, low + 0.1, 100.0)
    resolution = ask.number("resolution", "Step of the ranges, m (0: none)", 0.01, 0.0, 0.5)
    speed = ask.number("speed_max", "Largest speed, m/s", 0.5, 0.01, 10.0)
    turn = ask.number("turn_max", "Largest turning rate, rad/s", 1.0, 0.01, 20.0)
    synchro = ask.is_given("synchro") or (
        driver not in {"ros2", "arcos"}
        and ask.choice("wheels", "Do the wheels turn without the body?", ("no", "yes")) == "yes"
    )
    usual = ARCOS_BAUD if driver == "arcos" else BAUD
    baud = ask.count("baud", "Speed of the line, bits per second", usual, 300, 4000000)
    port = "" if driver == "ros2" else ask.text("port", "Serial port (empty: named when it runs)", "")
    preset = _preset(driver, sensors) if mounting.sensors is None else "single"
    step_s = max(0.05 if driver == "denning" else 0.041, math.ceil(1100.0 * time_of_flight_s(high)) * 1e-3)
    return RobotDraft(
        name,
        driver,
        mounting.count,
        mounting.radius_m,
        mounting.sensors,
        beam,
        resolution,
        low,
        high,
        preset,
        step_s,
        body,
        speed,
        turn,
        synchro,
        baud,
        port,
    )


def write_world(file: str, given: Given, *, yes: bool, force: bool) -> int:
    """Write a world file and return the exit code; parameters as of `runtime.cli.commands.init.world`."""
    ask = _questions(file, given, yes=yes, force=force)
    width = ask.number("width", "Size of the room along x, m", 8.0, 1.0, 1000.0)
    depth = ask.number("depth", "Size of the room along y, m", 6.0, 1.0, 1000.0)
    drums = ask.count("drums", "Number of drums", 4, 0, 12)
    ask.refuse_unused("--drums", ("drum_radius", "surfaces") if drums else ("surfaces",))
    radius = ask.number("drum_radius", "Radius of a drum, m", 0.3048, 0.02, 0.1 * min(width, depth)) if drums else 0.0
    surfaces = ask.choice("surfaces", "How surfaces reflect", ("cone", "specular", "rays"))
    x, y = 0.5 * width, 0.5 * depth
    corners = [(-x, -y), (x, -y), (x, y), (-x, y)]
    walls = "".join(
        f"\n[[wall]]\nx1_m = {a[0]:g}\ny1_m = {a[1]:g}\nx2_m = {b[0]:g}\ny2_m = {b[1]:g}\n"
        for a, b in zip(corners, [*corners[1:], corners[0]], strict=True)
    )
    turns = [2.0 * math.pi * (k + 0.5) / drums for k in range(drums)]
    stands = "".join(
        f"\n[[drum]]\nx_m = {0.6 * x * math.cos(turn):.3f}\ny_m = {0.6 * y * math.sin(turn):.3f}\n"
        f"radius_m = {radius:g}\n"
        for turn in turns
    )
    text = f"""# A room of your own for the emulator: metres; x to the right, y up, headings counter-clockwise.
{walls}{stands}
[start]
x_m = 0.0
y_m = 0.0
heading_deg = 0.0

[acoustics]
model = "{surfaces}"  # cone: each point of a surface answers; specular: surfaces are mirrors; rays: where rays hit
noise_m = 0.005
"""
    return _write(file, text, force=force)


def write_model(file: str, given: Given, *, yes: bool, force: bool) -> int:
    """Write a model file and return the exit code; parameters as of `runtime.cli.commands.init.model`."""
    ask = _questions(file, given, yes=yes, force=force)
    name = ask.text("name", "What such an object is called", Path(file).stem)
    is_round = ask.choice("shape", "Its shape", ("round", "box")) == "round"
    ask.refuse_unused("--shape", ("radius",) if is_round else ("length", "width"))
    if is_round:
        radius = ask.number("radius", "Its radius, m", 0.3048, 0.02, 10.0)
        turns = [2.0 * math.pi * k / CORNERS for k in range(CORNERS)]
        points = [(radius * math.cos(turn), radius * math.sin(turn)) for turn in turns]
        arc = f"arc_radius_m = {radius:g}  # the true radius, which the corners approximate\n"
    else:
        x = 0.5 * ask.number("length", "Its length, m", 0.6, 0.02, 20.0)
        y = 0.5 * ask.number("width", "Its width, m", 0.4, 0.02, 20.0)
        points, arc = [(x, -y), (x, y), (-x, y), (-x, -y)], ""
    rows = "".join(f"  [{x:.6g}, {y:.6g}],\n" for x, y in points)
    text = f"""# An object of your own; the origin is the point whose position is reported.
name = {_json(name)}
closed = true
{arc}vertices_m = [
{rows}]
"""
    return _write(file, text, force=force)


def write_run(file: str, given: Given, *, yes: bool, force: bool) -> int:
    """Write a run file and return the exit code; parameters as of `runtime.cli.commands.init.run_file`."""
    ask = _questions(file, given, yes=yes, force=force)
    robot = ask.text("robot", "Robot file, or the name of a shipped one", "denning")
    world = ask.text("world", "World file for the emulator, or the name of a shipped one", "hallway")
    # A path counts from the folder of the file that names it.
    fitting, note = models_for(str(Path(file).parent / world) if names_a_path(world) else world)
    models = [one.strip() for one in ask.text("models", f"Models, separated by commas{note}", fitting).split(",")]
    mission = ask.text("mission", "Mission file or name (-: none)", "-")
    text = f"""# A run of your own. `echolocate run` drives the emulated robot; with --port, the real one.
robot = {_json(robot)}
world = {_json(world)}  # for the emulator only
models = {_json(models)}{f"  #{note}" if note and models == [fitting] else ""}
{"# mission = " + _json("patrol") + "  # what to do once armed" if mission == "-" else "mission = " + _json(mission)}
"""
    return _write(file, text, force=force)


def models_for(world: str) -> tuple[str, str]:
    """Return the shipped model that a world's drums have, and a note where they have another size than any.

    Raises
    ------
    UserError
        The world cannot be read.
    """
    radii = {drum.radius_m for drum in load_world(world).drum}
    shipped = {name: load_model(name).arc_radius_m for name in list_shipped("models")}
    sizes = {name: radius for name, radius in shipped.items() if radius is not None}
    for name, size in sorted(sizes.items(), reverse=True):  # the paper's half drum before the whole one
        if any(math.isclose(size, radius, rel_tol=0.02) for radius in radii):
            return name, ""
    if not radii:
        return "drum", " (the world has no drums: put your own model here, from echolocate init model)"
    said = ", ".join(f"{radius:g} m" for radius in sorted(radii))
    return "drum", f" (the world's drums have the radius {said}: put your own model here, from echolocate init model)"


def _questions(file: str, given: Given, *, yes: bool, force: bool) -> Questions:
    check_outputs({"FILE": file}, force=force)  # before any question
    answers = {name: value for name, value in given.items() if name not in {"file", "yes", "force"}}
    return Questions(answers, asks=not yes and sys.stdin.isatty())


def _preset(driver: str, sensors: int) -> str:
    """Return the pattern that fires as many sensors at a time as the robot can."""
    at_a_time = {"arcos": sensors // ARRAY, "rflex": sensors // ARRAY, "ros2": 1}.get(driver, 8)
    at_a_time = min(at_a_time, max(1, sensors // 2))  # neighbours hear each other
    return next(name for count, name in AT_A_TIME if count <= at_a_time and sensors % count == 0)


def _json(value: object) -> str:
    """Return a text or a list of texts as TOML has it, which is as JSON has it."""
    return orjson.dumps(value).decode()


def _write(file: str, text: str, *, force: bool) -> int:
    """Write a file once it is known to be good; an existing one is replaced only then.

    Raises
    ------
    UserError
        The values contradict each other, or the file cannot be written.
    """
    check_outputs({"FILE": file}, force=force)
    notes: list[str] = []
    draft = Path(file).with_name(f".{Path(file).name}.draft.toml")
    try:
        with writing("FILE", draft):
            draft.write_text(text, encoding="utf-8")
        checked = load_any(str(draft), ())
        if isinstance(checked, Settings):
            refuse_undrivable(checked)
            notes = lint_settings(checked)
        draft.replace(file)
    except (UserError, FiringError) as error:
        said = str(error).replace(str(draft), file)
        raise UserError(f"{said}; nothing was written", WRONG_CALL) from error
    finally:
        draft.unlink(missing_ok=True)
    for note in notes:
        sys.stdout.write(f"{file}: {note}\n")
    path = file if names_a_path(file) else f"./{file}"  # or it is taken for a shipped name
    sys.stdout.write(f"{file}: written; look at it, then: echolocate check {path}\n")
    return DONE
