"""`echolocate firmware`: the files to copy to a board, and the robot file for them."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Final, Literal

from config.errors import DONE, FAILED, WRONG_CALL, UserError
from config.files import one_line
from runtime.cli.options import Force

MADE_BY: Final = "made by `echolocate firmware`"
"""In the first line of a robot file of its own."""
ROBOT_NAME: Final = "robot.toml"


def firmware(*, board: Literal["pico", "esp32"], out: str, force: Force = False) -> int:
    """Write the firmware of a ring and base that anybody can build, and the robot file that matches it.

    Pins and geometry are in robot_config.py. One that is in the folder already is kept: edit it and call this again.

    Parameters
    ----------
    board
        Raspberry Pi Pico (RP2040), or ESP32; both with MicroPython.
    out
        Folder for the files.
    force
        Overwrite files that were changed there, robot_config.py excepted.

    Raises
    ------
    UserError
        A file differs, or cannot be written; or robot_config.py is wrong.
    """
    from drivers.firmware.bundle import CONFIG_NAME, board_files, check_pins, read_config, robot_file

    folder = Path(out)
    files = board_files(board)
    try:
        config_file = folder / CONFIG_NAME
        is_kept = config_file.exists()
        if is_kept:
            files[CONFIG_NAME] = config_file.read_text("utf-8")
        place = one_line(str(config_file))
        values = read_config(files[CONFIG_NAME], place)
        check_pins(values, board, place)
        files[ROBOT_NAME] = robot_file(values, place)
        _refuse_changed(folder, files, force=force)
        for name, text in files.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text(text, "utf-8")
    except UnicodeDecodeError as error:
        raise UserError(f"{one_line(str(folder))}: a file in it is not UTF-8 ({error.reason})", WRONG_CALL) from error
    except OSError as error:
        where = one_line(str(error.filename or folder))
        raise UserError(f"--out: {where}: {error.strerror}; choose another folder", FAILED) from error
    _say_what_next(folder, is_kept=is_kept)
    return DONE


def _refuse_changed(folder: Path, files: dict[str, str], *, force: bool) -> None:
    """Raise if a file would lose its changes; a robot file that this command wrote is made anew each time."""
    changed = []
    for name, text in files.items():
        before = (folder / name).read_text("utf-8") if (folder / name).exists() else text
        is_own = name == ROBOT_NAME and MADE_BY in before.partition("\n")[0]
        if before != text and not is_own:
            changed.append(name)
    if changed and not force:
        names = ", ".join(changed)
        raise UserError(
            f"--out {one_line(str(folder))}: {names} differ from this program's; use --force to overwrite them, or "
            f"another folder",
            WRONG_CALL,
        )


def _say_what_next(folder: Path, *, is_kept: bool) -> None:
    from drivers.firmware.bundle import CONFIG_NAME

    shown = one_line(str(folder))
    kept = "kept" if is_kept else "edit it to your pins and geometry, then run this command again"
    sys.stdout.write(
        f"{shown}/{CONFIG_NAME}: {kept}\n"
        f"{shown}/main.py, {shown}/ring/: the firmware\n"
        f"{shown}/{ROBOT_NAME}: the robot file, made from {CONFIG_NAME}\n"
        f"Copy to the board, which has MicroPython:\n"
        f"  mpremote fs cp -r {shown}/ring {shown}/{CONFIG_NAME} {shown}/main.py :\n"
        f"  mpremote reset\n"
        f"Then: echolocate ring-test PORT --robot {shown}/{ROBOT_NAME}\n"
    )
