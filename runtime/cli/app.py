"""The command `echolocate`: what can be called, with which options, and how each call ends.

Commands import what they need when they are called, so that help and mistakes answer at once, and numba hears where
its cache is before it is loaded.
"""

from __future__ import annotations

import os
import sys
from typing import Annotated, Literal

from cyclopts import App, CycloptsError, Parameter

from config.errors import DONE, FAILED, WRONG_CALL, UserError
from runtime import VERSION
from runtime.cli.app_analysis import export, figures, report
from runtime.cli.options import ConfigFile, Flag, JsonFile, ModelFiles, RobotFile, Seed, Sets, Several, UnitsOption
from runtime.simulation.scene_names import SceneName

app = App(
    name="echolocate",
    help="A robot's main process that recognises and locates objects by sonar alone.",
    version=VERSION,
)


@app.command
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
    json: JsonFile = None,
    world: str | None = None,
    seed: Seed = 0,
    trace: str | None = None,
    faults: str | None = None,
    units: UnitsOption = "m",
    sets: Sets = (),
) -> int:
    """Run the robot's main process; without a port, on the emulator in the paper's hall.

    SIGUSR1 arms it, SIGUSR2 halts it, SIGHUP has it read the run file again, SIGINT and SIGTERM end it.

    Parameters
    ----------
    port
        Serial port of the robot. The robot waits in READY until it is armed.
    arm
        Arm once, at the start. Without a port this is done anyway.
    seconds
        End after this time.
    headless
        No live view: log lines instead.
    record
        Record the run into this file, instead of into the folder of recordings; a name in .csv gives a ring log.
    no_record
        Leave no recording.
    no_console
        Serve no page to watch and drive it by.
    world
        World of the emulator, a file or a name.
    seed
        Of everything random in the emulator.
    trace
        Write the emulator's truth to this CSV file.
    faults
        Fault script of the emulator.
    """
    from runtime.cli.commands.run import Emulation, run_robot

    emulation = Emulation(world=world, seed=seed, trace=trace, faults=faults)
    return run_robot(
        config, sets, port=port, arm=arm, seconds=seconds, headless=headless, record=record,
        no_record=no_record, no_console=no_console, json_file=json, emulation=emulation, units=units,
    )  # fmt: skip


@app.command
def emulate(
    *,
    world: str | None = None,
    link: str | None = None,
    faults: str | None = None,
    seed: Seed = 0,
    robot: RobotFile = None,
    trace: str | None = None,
    latency: str | None = None,
    clock: float = 0.0,
    control: Annotated[bool, Flag] = False,
    config: str | None = None,
    sets: Sets = (),
    end_with_parent: Annotated[bool, Parameter(negative="", show=False)] = False,
) -> int:
    """Be the robot's side alone, on a pseudo-terminal, until interrupted.

    Parameters
    ----------
    world
        What stands in the hall: a file or the name of a shipped world.
    link
        Path that will lead to the pseudo-terminal.
    faults
        Fault script.
    seed
        Of everything random.
    trace
        Write the truth to this CSV file, a hundred rows a second.
    latency
        Write to this CSV file when each echo had left and when each drive command came.
    clock
        What the robot's own clock shows at first, seconds; it wraps at 4294.967296.
    control
        Obey laws of time from standard input, each a line: pace NUMBER HOST_S RUN_S FACTOR UNTIL_S. At the host's
        monotonic time HOST_S it is RUN_S for the robot, and goes on by FACTOR until it stands still at UNTIL_S. To
        standard output goes how far it has lived: at NUMBER RUN_S.
    config
        Run file to take robot and world from.
    """
    from runtime.cli.commands.emulate import emulate_robot

    return emulate_robot(
        config, sets, world=world, robot=robot, link=link, faults=faults, seed=seed, trace=trace,
        latency=latency, clock_s=clock, end_with_parent=end_with_parent, control=control,
    )  # fmt: skip


@app.command
def replay(
    log: str,
    /,
    *,
    verify: Annotated[bool, Flag] = False,
    other: Annotated[str | None, Parameter(name="--with")] = None,
    since: Annotated[float, Parameter(name="--from")] = 0.0,
    until: Annotated[float | None, Parameter(name="--to")] = None,
    speed: float | None = None,
    robot: RobotFile = None,
    model: ModelFiles = (),
    json: JsonFile = None,
    units: UnitsOption = "m",
    sets: Sets = (),
) -> int:
    """Run the program again over a recording of a run, or perception over a ring log.

    Parameters
    ----------
    log
        A recording (MCAP), or a CSV with the header t,x,y,theta[,ring_yaw],r00,r01,…
    verify
        Fail unless every cycle comes out as it was recorded, to the bit.
    other
        Run file with other settings: say what would have been seen otherwise. So does --set.
    since
        Begin this many seconds after the recording's first cycle.
    until
        End this many seconds after it.
    speed
        This many times as fast as it was, in the live view; as fast as possible where it is not given.
    """
    from pathlib import Path

    from runtime.cli.commands.replay_ring_log import replay_log
    from runtime.recording.reader import is_recording

    if is_recording(Path(log)):
        from runtime.cli.commands.replay_recording import Span, replay_recording

        return replay_recording(
            log, sets, span=Span(since, until, speed), verify=verify, other=other, robot=robot, models=model,
            json_file=json, units=units,
        )  # fmt: skip
    if verify or other is not None or since or until is not None or speed is not None:
        raise UserError(
            f"{log}: is a ring log; --verify, --with, --from, --to and --speed are for recordings of a run (MCAP)",
            WRONG_CALL,
        )
    return replay_log(log, sets, robot=robot, models=model, json_file=json, units=units)


@app.command
def recover(recording: str, /, *, out: str | None = None) -> int:
    """Restore what can be read of a recording that was cut off or damaged.

    Parameters
    ----------
    recording
        The damaged file; it is left as it is.
    out
        Where the restored one goes; where it is not given, beside it, as NAME-recovered.mcap.
    """
    from runtime.cli.commands.recover import recover_recording

    return recover_recording(recording, out)


@app.command
def experiment(
    name: Literal["hallway", "irregular", "budget"],
    /,
    *,
    method: Literal["paper", "bayes"] = "bayes",
    scene: SceneName | None = None,
    world: str | None = None,
    model: ModelFiles = (),
    budget_ms: Annotated[tuple[float, ...], Several] = (0.2, 0.5, 1.0, 2.0, 5.0),
    quanta: Annotated[tuple[float, ...], Several] = (),
    seeds: Seed = 1,
    out: str | None = None,
    json: JsonFile = None,
    units: UnitsOption = "ft",
    sets: Sets = (),
) -> int:
    """Repeat the paper's experiment in virtual time, and print its Table 2.

    Parameters
    ----------
    name
        The simulated hallway, the irregular one of the real run, or what smaller budgets cost in a hall of 40 drums.
    method
        How objects are recognised.
    scene
        Instead of driving the robot, give perception alone a scene's readings at exact poses.
    world
        Another world, a file or a name.
    budget_ms
        For `budget`: processor time that perception has in a cycle, ms.
    quanta
        For `budget`: so many quanta a cycle instead, which makes the table repeatable; 0.1 is one in ten cycles.
    seeds
        Repeat with this many seeds, from 0 on.
    out
        Folder for recording, pictures and report of the run with seed 0.
    """
    from runtime.cli.commands.experiment import run_experiment, run_scenes

    sets = (*sets, f"perception.method={method}")
    if scene is not None and out is not None:
        raise UserError("--scene gives perception readings without a run: there is nothing to record in --out",
                        WRONG_CALL)  # fmt: skip
    if name == "budget":
        from runtime.cli.commands.budget import run_budgets

        if scene is not None or world is not None:
            raise UserError("experiment budget has a hall of its own: leave out --scene and --world", WRONG_CALL)
        return run_budgets(
            sets, budgets_ms=budget_ms, quanta=quanta, models=model, seeds=seeds, json_file=json, units=units
        )
    if scene is not None:
        if name != "hallway" or world is not None:
            raise UserError("--scene is a hallway of its own: call `experiment hallway`, without --world", WRONG_CALL)
        return run_scenes(scene, sets, models=model, seeds=seeds, json_file=json, units=units)
    return run_experiment(name, sets, world=world, models=model, seeds=seeds, out=out, json_file=json, units=units)


for command in (figures, report, export):
    app.command(command)


@app.command
def check(config: str, /, *, sets: Sets = ()) -> int:
    """Say whether a configuration is good, and if not, where and why.

    Parameters
    ----------
    config
        Run, robot, world or model file, or the name of a shipped run.
    """
    from runtime.cli.commands.check import check_config

    return check_config(config, sets)


@app.command
def service(
    config: ConfigFile = None, /, *, port: str | None = None, user: str | None = None, sets: Sets = ()
) -> int:
    """Print a systemd unit that runs the robot's main process from boot on; it never arms the robot.

    Parameters
    ----------
    port
        Serial port of the robot, where the run file names none.
    user
        Who runs it; where it is not given, a user that systemd makes for it.
    """
    from runtime.cli.commands.service import print_service

    return print_service(config, sets, port=port, user=user)


def complain(text: str) -> None:
    """Say what is wrong on stderr, one line for each thing."""
    for line in text.splitlines() or [""]:
        sys.stderr.write(f"echolocate: {line}\n")


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit with 0 done, 1 the work failed, 2 the call or configuration was wrong."""
    try:
        code = run_command(sys.argv[1:] if arguments is None else arguments)
        sys.stdout.flush()
    except BrokenPipeError:
        # Whoever read has left, as `head` does. Python flushes once more at the end, so that must lead somewhere.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = FAILED
    sys.exit(code)


def run_command(arguments: list[str]) -> int:
    """Run one command and return its exit code; what a user can cause becomes a line on stderr."""
    from runtime.support.kernel_cache import use_kernel_cache

    use_kernel_cache()
    try:
        result = app(arguments, exit_on_error=False, print_error=False, result_action="return_value")
    except CycloptsError as error:
        complain(f"{' '.join(str(error).split())} See `echolocate --help`.")
        return WRONG_CALL
    except UserError as error:
        complain(str(error))
        return error.exit_code
    except KeyboardInterrupt:
        return FAILED
    return result if isinstance(result, int) else DONE


if __name__ == "__main__":
    main()
