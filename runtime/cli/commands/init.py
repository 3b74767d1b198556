"""The commands that write a first file of one's own: robot, world, model, run; and a package, `init plugin`."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Annotated, Final, Literal

from cyclopts import App, Parameter

from runtime.cli.options import Count, Flag, Force

Yes = Annotated[bool, Parameter(negative="", show_default=False, help="Ask nothing; take the defaults.")]

app = App(name="init")


@Parameter(name="*")
@dataclass(frozen=True)
class RobotOptions:
    """Answers to the questions of `init robot`; what is None is asked."""

    driver: Annotated[
        str | None,
        Parameter(
            help="The robot's protocol: denning (also rings that you build), arcos (Pioneer), rflex (B21r, "
            "Magellan), ros2, or that of an installed package."
        ),
    ] = None
    name: Annotated[str | None, Parameter(help="What the robot is called.")] = None
    layout: Annotated[
        Literal["all-round", "in-front", "one-by-one"] | None,
        Parameter(
            help="Where the sensors look: all round, equally spaced, the first one forward; in front; or one by one, "
            "which is asked for each."
        ),
    ] = None
    sensors: Annotated[Count | None, Parameter(help="Number of sensors.")] = None
    spacing: Annotated[float | None, Parameter(help="Of sensors in front, degrees from one to the next.")] = None
    ring_radius: Annotated[float | None, Parameter(help="Distance of the sensors from the middle, m.")] = None
    beam_half_angle: Annotated[float | None, Parameter(help="Half the width of a sensor's beam, degrees.")] = None
    range_min: Annotated[float | None, Parameter(help="Least range that a sensor reports, m.")] = None
    range_max: Annotated[float | None, Parameter(help="Greatest range that a sensor reports, m.")] = None
    resolution: Annotated[float | None, Parameter(help="Step of the reported ranges, m; 0 if they have none.")] = None
    body_radius: Annotated[float | None, Parameter(help="Radius of the body, m.")] = None
    speed_max: Annotated[float | None, Parameter(help="Largest speed, m/s.")] = None
    turn_max: Annotated[float | None, Parameter(help="Largest turning rate, rad/s.")] = None
    synchro: Annotated[bool, Flag, Parameter(help="The wheels turn, the body with its ring does not.")] = False
    baud: Annotated[Count | None, Parameter(help="Speed of the line, bits per second.")] = None
    port: Annotated[
        str | None, Parameter(help="Serial port of the robot, as /dev/ttyUSB0; by default a run names it.")
    ] = None


ASK_ALL: Final = RobotOptions()


@app.command
def robot(file: str, /, *, options: RobotOptions = ASK_ALL, yes: Yes = False, force: Force = False) -> int:
    """Write a robot file: where the sensors look, the body, the line and the driver.

    Parameters
    ----------
    file
        The file to write, as my-robot.toml.
    options
        What is not asked.
    """
    from runtime.cli.commands.init_files import write_robot

    return write_robot(file, asdict(options), yes=yes, force=force)


@app.command
def world(
    file: str,
    /,
    *,
    width: float | None = None,
    depth: float | None = None,
    drums: Count | None = None,
    drum_radius: float | None = None,
    surfaces: Literal["cone", "specular", "rays"] | None = None,
    yes: Yes = False,
    force: Force = False,
) -> int:
    """Write a world file for the emulator: a rectangular room with drums, the robot in its middle.

    Parameters
    ----------
    file
        The file to write, as my-room.toml.
    width
        Size of the room along x, m.
    depth
        Size of the room along y, m.
    drums
        Number of drums in it, 0 to 12.
    drum_radius
        Radius of a drum, m.
    surfaces
        How they reflect: cone (each point answers), specular (as mirrors) or rays (where a few rays hit).
    """
    given = locals()  # the options by their names, as the questions have them
    from runtime.cli.commands.init_files import write_world

    return write_world(file, given, yes=yes, force=force)


@app.command
def model(
    file: str,
    /,
    *,
    name: str | None = None,
    shape: Literal["round", "box"] | None = None,
    radius: float | None = None,
    length: float | None = None,
    width: float | None = None,
    yes: Yes = False,
    force: Force = False,
) -> int:
    """Write an object model: a round object, or one with a rectangular floor plan.

    Parameters
    ----------
    file
        The file to write, as bin.toml.
    name
        What such an object is called: letters, digits, - and _.
    shape
        Round or box.
    radius
        Of a round object, m.
    length
        Of a box, along its own x axis, m.
    width
        Of a box, along its own y axis, m.
    """
    given = locals()  # the options by their names, as the questions have them
    from runtime.cli.commands.init_files import write_model

    return write_model(file, given, yes=yes, force=force)


@app.command(name="run")
def run_file(
    file: str,
    /,
    *,
    robot: str | None = None,
    world: str | None = None,
    models: Annotated[str | None, Parameter(name="--model")] = None,
    mission: str | None = None,
    yes: Yes = False,
    force: Force = False,
) -> int:
    """Write a run file: which robot drives, among what, what it recognises, and what it does.

    Parameters
    ----------
    file
        The file to write, as my-run.toml.
    robot
        Robot file, or the name of a shipped one.
    world
        World file for the emulator, or the name of a shipped one.
    models
        Object models to look for: files or names of shipped ones, separated by commas.
    mission
        What to do once armed: a mission file or the name of a shipped one; - for none.
    """
    given = locals()  # the options by their names, as the questions have them
    from runtime.cli.commands.init_files import write_run

    return write_run(file, given, yes=yes, force=force)


@app.command
def plugin(name: str, /, *, kind: Literal["robot", "schema"] = "robot") -> int:
    """Write a package of your own into a new folder: a robot that speaks lines, with its emulator, or a schema.

    Parameters
    ----------
    name
        Of the robot or the schema, of its package and of the folder.
    kind
        Robot or schema.
    """
    from runtime.cli.commands.init_plugin import write_plugin

    return write_plugin(name, kind)
