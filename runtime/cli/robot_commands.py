"""The commands that run or describe a robot: `run`, `emulate`, `check`, `settings`, `service`."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from runtime.cli.options import ConfigFile, Count, Flag, Force, JsonFile, RobotFile, Sets, UnitsOption, WorldFile


def run(
    config: ConfigFile = None,
    /,
    *,
    port: str | None = None,
    arm: Annotated[bool, Flag] = False,
    seconds: float | None = None,
    headless: Annotated[bool, Flag] = False,
    record: str | None = None,
    no_record: Annotated[bool, Flag] = False,
    no_console: Annotated[bool, Flag] = False,
    foxglove: Annotated[bool, Flag] = False,
    json: JsonFile = None,
    force: Force = False,
    map_file: Annotated[str | None, Parameter(name="--map")] = None,
    robot: RobotFile = None,
    world: str | None = None,
    mission: str | None = None,
    goal: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None,
    seed: Count = 0,
    trace: str | None = None,
    faults: str | None = None,
    units: UnitsOption = "m",
    sets: Sets = (),
) -> int:
    """Run the robot's main process; without a port, on an emulated robot.

    Signals: SIGUSR1 arms the robot, SIGUSR2 halts it, SIGHUP reloads the run file, SIGINT and SIGTERM end the run.

    Parameters
    ----------
    port
        Port of the robot, a serial device or socket://host:port; the robot then waits in READY until it is armed.
    arm
        Arm the robot once, at the start. The emulated robot is armed without this option.
    seconds
        End the run this long after recognition began.
    headless
        Print log lines instead of the live view.
    record
        Record into this file instead of the folder of recordings; a name that ends in .csv gives a ring log.
    no_record
        Record nothing.
    no_console
        Do not serve the operator console.
    foxglove
        Serve the run to Foxglove as well, from a process of its own; see `echolocate foxglove`.
    map_file
        The known room in which the robot finds itself: a world file, or the name of a shipped one.
    robot
        Robot file, or the name of a shipped one; None for that of the run file.
    world
        Emulated robot: world file, or the name of a shipped one; without CONFIG its shipped run is driven.
    mission
        What to do once armed: a mission file, or the name of a shipped one; None for that of the run file.
    goal
        Where to drive once armed: X,Y in metres, or X,Y,HEADING with the final heading in degrees, or the name of a
        place. A place in the map with --map, otherwise in odometry's frame, from where the run begins.
    seed
        Emulated robot: seed of everything random.
    trace
        Emulated robot: write its true poses to this file (CSV).
    faults
        Emulated robot: fault script.
    config
        Run file, or the name of a shipped one; None for the default settings.
    json
        File for a summary at the end of the run (JSON); None for no file.
    force
        Overwrite files that exist already.
    units
        Units of the printed tables.
    sets
        Single settings, each `path=value`, that override the files'.
    """
    from runtime.cli.commands.run import EmulatorOptions, run_robot

    emulator = EmulatorOptions(world=world, seed=seed, trace=trace, faults=faults, force=force)
    return run_robot(
        config, sets, robot=robot, port=port, arm=arm, seconds=seconds, headless=headless, record=record,
        map_file=map_file, mission=mission, goal=goal, no_record=no_record, no_console=no_console, foxglove=foxglove,
        json_file=json, force=force, emulator=emulator, units=units,
    )  # fmt: skip


def emulate(
    *,
    world: WorldFile = None,
    link: str | None = None,
    tcp: str | None = None,
    faults: str | None = None,
    seed: Count = 0,
    robot: RobotFile = None,
    trace: str | None = None,
    latency: str | None = None,
    force: Force = False,
    clock: float = 0.0,
    control: Annotated[bool, Flag] = False,
    config: ConfigFile = None,
    sets: Sets = (),
    end_with_parent: Annotated[bool, Parameter(negative="", show=False)] = False,
) -> int:
    """Emulate a robot on a pseudo-terminal or a TCP port until interrupted.

    Parameters
    ----------
    link
        Create a symbolic link to the pseudo-terminal at this path.
    tcp
        Listen on this TCP port of this machine in place of a pseudo-terminal; HOST:PORT to serve a network.
    faults
        Fault script.
    seed
        Seed of everything random.
    trace
        Write the true poses to this file (CSV), 100 rows a second.
    latency
        Write to this file (CSV) when each echo was sent and when each drive command arrived.
    force
        Overwrite files that exist already.
    clock
        Initial value of the robot's own clock, s; it wraps at 4294.967296.
    control
        Take time control from standard input, one line per request: time_scale NUMBER HOST_S RUN_S FACTOR UNTIL_S.
        From the host's monotonic time HOST_S on, the robot's time starts at RUN_S and runs FACTOR times as fast until
        UNTIL_S. The time reached is reported on standard output: acknowledged NUMBER RUN_S.
    config
        Run file that names robot and world.
    world
        World file, or the name of a shipped one; None for that of the run file.
    robot
        Robot file, or the name of a shipped one; None for that of the run file.
    sets
        Single settings, each `path=value`, that override the files'.
    end_with_parent
        End when the process that started the emulator has ended; for use by `run`.
    """
    from runtime.cli.commands.emulate import emulate_robot

    return emulate_robot(
        config, sets, world=world, robot=robot, link=link, tcp=tcp, faults=faults, seed=seed, trace=trace,
        latency=latency, force=force, clock_s=clock, end_with_parent=end_with_parent, control=control,
    )  # fmt: skip


def check(config: str, /, *, sets: Sets = ()) -> int:
    """Check a configuration file; report each error with its place and the likely fix.

    Parameters
    ----------
    config
        Run, robot, world, model or mission file, or the name of a shipped run.
    """
    from runtime.cli.commands.check import check_config

    return check_config(config, sets)


def service(
    config: ConfigFile = None,
    /,
    *,
    port: str | None = None,
    user: str | None = None,
    own: Annotated[bool, Flag] = False,
    sets: Sets = (),
) -> int:
    """Print a systemd unit that runs the robot's main process from boot on; it never arms the robot.

    Parameters
    ----------
    port
        Serial port of the robot, unless the run file names one.
    user
        User that runs it; by default one that systemd creates.
    own
        Print a unit for your own manager (systemctl --user), which needs no rights of an administrator.
    config
        Run file, or the name of a shipped one; None for the default settings.
    sets
        Single settings, each `path=value`, that the service passes to `run`.
    """
    from runtime.cli.commands.service import print_service

    return print_service(config, sets, port=port, user=user, own=own)


def settings_command(text: str = "", /, *, out: str | None = None, force: Force = False) -> int:
    """List the keys of all files with values, defaults and meaning.

    Parameters
    ----------
    text
        List only keys whose name or meaning contains this.
    out
        Write the whole list into this file, as Markdown.
    force
        Overwrite an existing file.
    """
    from runtime.cli.commands.settings import run_settings

    return run_settings(text, out, force=force)
