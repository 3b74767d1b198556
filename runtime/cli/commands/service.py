"""`echolocate service`: a systemd unit that runs the robot's main process."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Final

from config.errors import DONE, WRONG_CALL, UserError
from runtime.cli.options import ConfigFile, Flag, Sets

UNIT: Final = """\
# The main process of a robot. After a boot or a failure it waits in READY until it is armed:
#   systemctl kill --kill-whom=main --signal=USR1 echolocate    arms it; USR2 halts it
# Install:
#   echolocate service … > /etc/systemd/system/echolocate.service && systemctl enable --now echolocate
[Unit]
Description=echolocate: main process of the robot on {port}
# The robot may be switched on much later than this computer.
StartLimitIntervalSec=0

[Service]
Type=notify
NotifyAccess=main
ExecStart={command}
# Reads the run file again: what a running robot may change takes effect at once. It neither arms nor moves the robot,
# and a file with an error changes nothing; the log says which it was.
ExecReload=/bin/kill -HUP $MAINPID
{where}{user}
# The group that may open serial ports.
SupplementaryGroups=dialout
StateDirectory=echolocate
CacheDirectory=echolocate
Environment=XDG_STATE_HOME=%S XDG_CACHE_HOME=%C
# The first start compiles kernels.
TimeoutStartSec=300
# Only the control cycle feeds the watchdog, and only while every part of the process works.
WatchdogSec=2
# On SIGTERM it halts the base, then waits for the disk.
KillSignal=SIGTERM
# A run that is ended while it waits for kernels or for the robot exits with 128 + 15, which is no failure.
SuccessExitStatus=143
TimeoutStopSec=20
Restart=on-failure
RestartSec=2
# For the settings realtime.priority and realtime.lock_memory.
LimitRTPRIO=99
LimitMEMLOCK=infinity

[Install]
WantedBy=multi-user.target
"""


SYSTEM_ONLY: Final = (
    "DynamicUser=",
    "User=",
    "SupplementaryGroups=",
    "# The group that",
    "StateDirectory=",
    "CacheDirectory=",
    "Environment=XDG_",
    "LimitRTPRIO=",
    "LimitMEMLOCK=",
    "# For the settings",
)
"""Lines that the manager of a user cannot carry out: the user's own folders, groups and limits hold."""


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

    Raises
    ------
    UserError
        The run file or a setting is wrong (the service would start for ever and fail), no port is given, or a name
        contains characters that a unit file cannot hold.
    """
    from config.load import load_settings

    settings = load_settings(config, sets)
    port = port or settings.link.port
    if port is None:
        raise UserError("a service needs the robot's serial port: set --port or link.port", WRONG_CALL)
    if any(not text.isprintable() for text in (port, user or "", config or "", *sets)):
        raise UserError("a unit file may contain printable characters only: choose other names", WRONG_CALL)
    if own and user is not None:
        raise UserError("--own is a unit for the manager of the user who installs it: leave out --user", WRONG_CALL)
    unit = systemd_unit(service_command(config, sets, port), port, user)
    sys.stdout.write(own_unit(unit) if own else unit)
    return DONE


def systemd_unit(command: Sequence[str], port: str, user: str | None) -> str:
    """Return the unit file.

    Parameters
    ----------
    command : sequence of str
        The command to run.
    port : str
        For the description.
    user : str, optional
        None for a user that systemd creates.
    """
    # A program that is not installed is found in its own folder.
    home = Path(__file__).resolve().parents[3]
    where = f"WorkingDirectory={_escape_specifiers(str(home))}\n" if command[0] == sys.executable else ""
    return UNIT.format(
        port=_escape_specifiers(port),
        command=" ".join(map(quote_for_systemd, command)),
        where=where,
        user="DynamicUser=yes" if user is None else f"User={_escape_specifiers(user)}",
    )


def own_unit(unit: str) -> str:
    """Return a unit for the manager of a user (`systemctl --user`)."""
    kept = "\n".join(line for line in unit.split("\n") if not line.startswith(SYSTEM_ONLY))
    kept = kept.replace("WantedBy=multi-user.target", "WantedBy=default.target").replace(
        "systemctl ", "systemctl --user "
    )
    return kept.replace("/etc/systemd/system/", "~/.config/systemd/user/")


def service_command(config: str | None, sets: Sequence[str], port: str) -> list[str]:
    """Return the command that the service runs; it never contains --arm.

    Parameters
    ----------
    config : str, optional
        Run file, or the name of a shipped one; None for the default settings.
    sets : sequence of str
        Single settings, each `path=value`, passed on as `--set`.
    port : str
        Serial port of the robot.
    """
    installed = Path(sys.executable).with_name("echolocate")
    program = [str(installed)] if installed.exists() else [sys.executable, "-m", "runtime.cli"]
    # A file must be found from any folder; a shipped run is found by its name.
    named = [] if config is None else [str(Path(config).resolve()) if Path(config).exists() else config]
    overrides = [word for text in sets for word in ("--set", text)]
    # Pages that are open come back after a restart; the user's own choice comes later and counts.
    kept = ["--set", "console.keep_token=true"]
    return [*program, "run", *named, "--port", port, "--headless", *kept, *overrides]


def quote_for_systemd(word: str) -> str:
    """Return a word of a command line, quoted so that systemd reads it as one word and expands nothing in it."""
    word = word.replace("\\", "\\\\").replace('"', '\\"').replace("%", "%%").replace("$", "$$")
    return f'"{word}"' if not word or any(c in word for c in " '\";\\") else word


def _escape_specifiers(text: str) -> str:
    return text.replace("%", "%%")
