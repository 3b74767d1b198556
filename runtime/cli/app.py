"""The application `echolocate`: its commands, and the exit code of each call.

Commands import what they need when they are called: help and wrong calls answer at once, and numba is imported after
its cache folder is set.
"""

from __future__ import annotations

import signal
import sys

from cyclopts import App, CycloptsError, Group

from config.errors import DONE, WRONG_CALL, UserError
from config.files import noting_files_read, one_line
from runtime.cli.board_commands import firmware, probe_command, ring_test_command
from runtime.cli.bridge_commands import fleet, foxglove, ros2, ros2_robot_command
from runtime.cli.experiment_commands import experiment, sweep, tune
from runtime.cli.first_signals import EXIT_CODE_BASE
from runtime.cli.init_commands import init_app
from runtime.cli.recording_commands import calibrate, export, figures, map_command, recover, replay, report, stand
from runtime.cli.robot_commands import check, emulate, run, service, settings_command
from runtime.cli.start_signals import ending_in_order


def version() -> str:
    """Return the version and the build."""
    from runtime.support.build import describe_build

    return describe_build()


app = App(
    name="echolocate",
    help="A robot's main process that recognises and locates objects by sonar alone.",
    help_epilogue=(
        "Exit status: 0 done, 1 the work failed, 2 the call or the configuration wrong, 128 + n ended by signal n."
    ),
    version=version,
    group_parameters=Group("Options"),
)
for title, commands in (
    ("Robot", (run, emulate, check, settings_command, service)),
    ("Recordings", (replay, report, figures, export, map_command, calibrate, stand, recover)),
    ("Simulation", (experiment, sweep, tune)),
    ("Other programs", (fleet, ros2, ros2_robot_command, foxglove)),
    ("A robot of your own", (probe_command, firmware, ring_test_command)),
):
    group = Group.create_ordered(title)
    for command in commands:
        app.command(command, name=command.__name__.removesuffix("_command").replace("_", "-"), group=group)
init_app.group = (Group.create_ordered("Files of your own"),)
app.command(init_app)
general = Group.create_ordered("General")
app.register_install_completion_command(
    help="Complete commands and options in this shell (bash, zsh, fish); adds a line to its start-up file."
)
for flag in ("--help", "--version", "--install-completion"):
    app[flag].group = general


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit: 0 done, 1 the work failed, 2 the call or the configuration was wrong."""
    try:
        with ending_in_order():
            code = run_command(sys.argv[1:] if arguments is None else arguments)
    except BrokenPipeError:  # the reader of the pipe has what it wants, as `head` does
        code = DONE
    sys.exit(code)


def run_command(arguments: list[str]) -> int:
    """Run one command and return its exit code; print a user's error on stderr."""
    from runtime.support.kernel_cache import use_kernel_cache

    try:
        use_kernel_cache()
        with noting_files_read():
            result = app(arguments, exit_on_error=False, print_error=False, result_action="return_value")
        sys.stdout.flush()
    except CycloptsError as error:
        print_error(f"{' '.join(str(error).split())} See `echolocate --help`.")
        return WRONG_CALL
    except UserError as error:
        print_error(str(error))
        return error.exit_code
    except KeyboardInterrupt:
        return EXIT_CODE_BASE + signal.SIGINT
    return result if isinstance(result, int) else DONE


def print_error(text: str) -> None:
    """Print an error on stderr, each line of it with the name of the program."""
    for line in text.splitlines() or [""]:
        sys.stderr.write(f"echolocate: {one_line(line)}\n")


if __name__ == "__main__":
    main()
