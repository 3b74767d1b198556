"""`echolocate service`: a systemd unit that runs the robot's main process as a robot's main process is run."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from config.errors import DONE, WRONG_CALL, UserError
from config.load import load_settings

UNIT: Final = """\
# The main process of a robot. It comes up in READY and stands until it is armed, after a failure as after a boot:
#   systemctl kill --kill-whom=main --signal=USR1 echolocate    arms it; USR2 halts it
# Install:
#   echolocate service … > /etc/systemd/system/echolocate.service && systemctl enable --now echolocate
[Unit]
Description=echolocate: main process of the robot on {port}
# The robot may be switched on much later than this machine.
StartLimitIntervalSec=0

[Service]
Type=notify
NotifyAccess=main
ExecStart={command}
{where}{user}
# May open serial ports, where this group may.
SupplementaryGroups=dialout
StateDirectory=echolocate
CacheDirectory=echolocate
Environment=XDG_STATE_HOME=%S XDG_CACHE_HOME=%C
# The first start compiles.
TimeoutStartSec=300
# Fed by the cycle while every part is well, and by nothing else.
WatchdogSec=2
# It halts the base first, then waits for the disk.
KillSignal=SIGTERM
TimeoutStopSec=20
Restart=on-failure
RestartSec=2
# For realtime.priority and realtime.lock_memory, where they are set.
LimitRTPRIO=99
LimitMEMLOCK=infinity

[Install]
WantedBy=multi-user.target
"""


def print_service(config: str | None, sets: Sequence[str], *, port: str | None, user: str | None) -> int:
    """Carry out the command; see `runtime.cli.app.service`."""
    settings = load_settings(config, sets)
    port = port or settings.link.port
    if port is None:
        raise UserError("a service needs the robot's serial port: give it as --port or link.port", WRONG_CALL)
    if any(not text.isprintable() for text in (port, user or "", *sets)):
        raise UserError("a unit file has room for printable characters only: choose other names", WRONG_CALL)
    sys.stdout.write(unit(command(config, sets, port), port, user))
    return DONE


def unit(words: Sequence[str], port: str, user: str | None) -> str:
    """Return the unit file.

    Parameters
    ----------
    words : sequence of str
        The command to run.
    port : str
        For the description.
    user : str, optional
        None for a user that systemd makes.
    """
    # A program that was not installed is found from its own folder.
    home = Path(__file__).resolve().parents[3]
    where = f"WorkingDirectory={_plain(str(home))}\n" if words[0] == sys.executable else ""
    return UNIT.format(
        port=_plain(port),
        command=" ".join(map(quoted, words)),
        where=where,
        user="DynamicUser=yes" if user is None else f"User={_plain(user)}",
    )


def command(config: str | None, sets: Sequence[str], port: str) -> list[str]:
    """Return the command that the service runs: never with --arm."""
    installed = Path(sys.executable).with_name("echolocate")
    program = [str(installed)] if installed.exists() else [sys.executable, "-m", "runtime.cli"]
    # A shipped run is a name; a file must be found from any folder.
    named = [] if config is None else [str(Path(config).resolve()) if Path(config).exists() else config]
    overrides = [word for text in sets for word in ("--set", text)]
    return [*program, "run", *named, "--port", port, "--headless", *overrides]


def quoted(word: str) -> str:
    """Return a word of a command line as systemd reads it: no specifier, no variable, one word."""
    word = word.replace("\\", "\\\\").replace('"', '\\"').replace("%", "%%").replace("$", "$$")
    return f'"{word}"' if not word or any(c in word for c in " '\";\\") else word


def _plain(text: str) -> str:
    return text.replace("%", "%%")
