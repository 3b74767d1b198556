"""`echolocate check`: check a configuration file."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from config.errors import DONE
from config.load import load_any
from config.places import check_places
from config.settings import Settings
from runtime.support.config_lint import lint_settings
from runtime.support.pattern_check import refuse_undrivable


def check_config(config: str, sets: Sequence[str]) -> int:
    """Print whether a configuration is good, with warnings, and return the exit code.

    Raises
    ------
    ConfigError
        The configuration is wrong; the message says what and where.
    FiringError
        Each value is valid, but the ring cannot carry out its firing pattern, or would not see where it drives.
    """
    settings = load_any(config, sets)
    if isinstance(settings, Settings):
        refuse_undrivable(settings)
        check_places(settings.mission, settings.places)
        for text in lint_settings(settings):
            sys.stdout.write(f"{config}: {text}\n")
    sys.stdout.write(f"{config}: good\n")
    return DONE
