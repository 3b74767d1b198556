"""`echolocate check`: check a configuration file."""

from __future__ import annotations

import sys

from config.errors import DONE, WRONG_CALL, UserError, naming_file
from runtime.cli.options import Sets


def check(config: str, /, *, sets: Sets = ()) -> int:
    """Check a configuration file; report each error with its place and the likely fix.

    Parameters
    ----------
    config
        Run, robot, world, model or mission file, or the name of one that is shipped or installed.

    Raises
    ------
    ConfigError
        The configuration is wrong; the message says what and where.
    UserError
        It is a run's data.
    FiringError
        Each value is valid, but the ring cannot carry out its firing pattern, or would not see where it drives.
    """
    from config.load import load_any
    from config.places import check_places
    from config.plugins import plugged_table
    from config.robot import NO_BODY
    from config.settings import Settings
    from config.toml_edit import inline
    from drivers.capabilities import after_kill
    from drivers.registry import deadman_s
    from runtime.support.blind_sides import refuse_blind_ways
    from runtime.support.config_lint import lint_settings
    from runtime.support.pattern_check import refuse_undrivable

    if config.lower().endswith((".csv", ".mcap")):
        raise UserError(
            f"{config}: by its name it is a ring log or a recording, and check reads configurations (TOML): "
            f"`echolocate replay {config}` reads it",
            WRONG_CALL,
        )
    settings = load_any(config, sets)
    if isinstance(settings, Settings):
        with naming_file(f"--set over {config}" if sets else config):
            refuse_undrivable(settings)
            refuse_blind_ways(settings)
            check_places(settings.mission, settings.places)
        for text in lint_settings(settings):
            sys.stdout.write(f"{config}: {text}\n")
        if (own := plugged_table(settings.robot.driver)) is not None:
            values = settings.own_table(settings.robot.driver, own).model_dump(mode="json", exclude_none=True)
            shown = ", ".join(f"{key} = {inline(value)}" for key, value in values.items())
            sys.stdout.write(f"{config}: [{settings.robot.driver}] {shown}\n")
        if settings.body != NO_BODY:
            sys.stdout.write(f"{config}: {after_kill(settings.body, deadman_s(settings))}\n")
    sys.stdout.write(f"{config}: good\n")
    return DONE
