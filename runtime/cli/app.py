"""The application `echolocate`: its commands, and the exit code of each call.

Commands import what they need when they are called: help and wrong calls answer at once, and numba is imported after
its cache folder is set.
"""

from __future__ import annotations

import signal
import sys
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from cyclopts import App, CycloptsError, Group

from config.errors import DONE, FAILED, WRONG_CALL, UserError
from config.files import noting_files_read, one_line
from runtime.cli.first_signals import EXIT_CODE_BASE
from runtime.cli.standard_streams import ReaderGoneError
from runtime.cli.start_signals import ending_in_order

COMMANDS: Final[Mapping[str, Mapping[str, str]]] = MappingProxyType({
    "Robot": {
        "run": "Run the robot's main process; without a port, on an emulated robot.",
        "emulate": "Emulate a robot on a pseudo-terminal or a TCP port until interrupted.",
        "check": "Check a configuration file; report each error with its place and the likely fix.",
        "settings": "List the keys of all files with values, defaults and meaning.",
        "service": "Print a systemd unit that runs the robot's main process from boot on; it never arms the robot.",
    },
    "Recordings": {
        "replay": "Replay a recording cycle by cycle, or run perception over a ring log.",
        "report":
            "Write one HTML page about a run: Table 2 with errors, figures, timing, link, stop reasons, settings.",
        "figures":
            "Draw a run as the paper does: raw data, segments, clusters, matched models, and an animation of it all.",
        "export":
            "Convert a run to the format of another program; some formats need `pip install 'echolocate[export]'`.",
        "map":
            "Write the map of a run as a world file, as an occupancy image with the YAML of ROS's map_server, "
            "as GeoJSON.",
        "calibrate":
            "Find a robot's mounts, beams and scales from a drive by a wall and a drum, and write them as a "
            "robot file.",
        "stand":
            "List what a robot heard where it stood, surface by surface, or with --map where in a known room it "
            "stood.",
        "recover": "Restore what can be read of a damaged or incomplete recording.",
    },
    "Simulation": {
        "experiment": "Repeat an experiment of the paper in virtual time, and print its Table 2.",
        "sweep":
            "Make the runs of a study on many processes or machines, and compare their settings; needs the "
            "extra `sweep`.",
        "tune":
            "Find better settings for your recordings or scenes, and write the changes as TOML; needs the extra "
            "`tune`.",
    },
    "Other programs": {
        "fleet": "Serve one page for several runs: mode, battery and place of each, HALT for one and for all.",
        "ros2":
            "Bridge a run and ROS 2: ranges, odometry, frames, objects out; velocities, goals, arm, disarm, halt in.",
        "ros2-robot":
            "Write the robot file of a robot that runs ROS 2, from its ranges, odometry and frames; nothing moves.",
        "foxglove": "Serve a live run to Foxglove, with the topics of `export --to foxglove`.",
    },
    "A robot of your own": {
        "probe":
            "Find out which robots answer on which ports, without moving anything, and which run on the local "
            "network.",
        "firmware":
            "Write the firmware of a ring and base that anybody can build, and the robot file that matches it.",
        "ring-test": "Fire each sensor of a robot by itself and report what it hears; with `--move`, try its motors.",
    },
    "Files of your own": {
        "init": "Write a first file of your own, with comments. What no option gives is asked for on a terminal.",
    },
})  # fmt: skip
"""Groups of commands, and the first line of each command's docstring, so that a list of them imports none."""
FUNCTIONS: Final = MappingProxyType({
    "calibrate": "robots.calibrate:calibrate", "experiment": "experiments.experiment:experiment",
    "firmware": "robots.firmware:firmware", "init": "init:app", "map": "map_run:map_run",
    "probe": "robots.probe:probe", "replay": "replay.replay:replay", "ring-test": "robots.ring_test:ring_test",
    "ros2-robot": "robots.ros2_robot:ros2_robot", "run": "run.run:run",
})  # fmt: skip
"""Where in `runtime.cli.commands` a command is, unless it is the function and the module of its own name."""


def place_of(name: str) -> str:
    """Return the module and the function of a command."""
    return f"runtime.cli.commands.{FUNCTIONS.get(name, f'{name}:{name}'.replace('-', '_'))}"


def version() -> str:
    """Return the version and the build."""
    from runtime.support.build import describe_build

    return describe_build()


app = App(
    name="echolocate",
    help="A robot's main process that recognises and locates objects by sonar alone.",
    help_epilogue=(
        "Exit status: 0 done, 1 the work failed, 2 the call or the configuration wrong, 3 no fault found, but not "
        "all could be shown to be good (ring-test), 128 + n ended by signal n."
    ),
    version=version,
    group_parameters=Group("Options"),
)
for title, commands in COMMANDS.items():
    group = Group.create_ordered(title)
    for name, summary in commands.items():
        app.command(place_of(name), name=name, help=summary, group=group)
general = Group.create_ordered("General")
app.register_install_completion_command(
    help="Complete commands and options in this shell (bash, zsh, fish); adds a line to its start-up file."
)
for flag in ("--help", "--version", "--install-completion"):
    app[flag].group = general


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit: 0 done, 1 the work failed, 2 the call or the configuration was wrong.

    An error of the program is printed as the interpreter would, which may not end while a thread compiles a kernel.
    """
    try:
        with ending_in_order():
            code = run_command(sys.argv[1:] if arguments is None else arguments)
    except ReaderGoneError:
        code = DONE
    except SystemExit as ended:
        code = ended.code if isinstance(ended.code, int) else DONE if ended.code is None else FAILED
        if isinstance(ended.code, str):
            sys.stderr.write(f"{ended.code}\n")
    except Exception as error:  # noqa: BLE001 - whatever it is
        sys.excepthook(type(error), error, error.__traceback__)
        code = FAILED
    from runtime.support.daemon_thread import exit_process

    exit_process(code)


def run_command(arguments: list[str]) -> int:
    """Run one command and return its exit code; print a user's error on stderr."""
    from runtime.support.kernel_cache import use_kernel_cache

    try:
        use_kernel_cache()
        show_whole_help(next(iter(arguments), ""))
        with noting_files_read():
            result = app(arguments, exit_on_error=False, print_error=False, result_action="return_value")
        sys.stdout.flush()
    except CycloptsError as error:
        asked = " ".join(["echolocate", *(error.command_chain or ())])
        print_error(f"{' '.join(str(error).split())} See `{asked} --help`.")
        return WRONG_CALL
    except UserError as error:
        print_error(str(error))
        return error.exit_code
    except KeyboardInterrupt:
        return EXIT_CODE_BASE + signal.SIGINT
    return result if isinstance(result, int) else DONE


def show_whole_help(name: str) -> None:
    """Let a command show its docstring, which says more than the line of it in the list."""
    if any(name in commands for commands in COMMANDS.values()) and app[name].default_command is not None:
        app[name].help = None


def print_error(text: str) -> None:
    """Print an error on stderr, each line of it with the name of the program."""
    for line in text.splitlines() or [""]:
        sys.stderr.write(f"echolocate: {one_line(line)}\n")


if __name__ == "__main__":
    main()
