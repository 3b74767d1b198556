"""`echolocate check`: check a configuration file."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from config.errors import DONE
from config.load import load_any
from config.settings import Settings
from drivers.registry import make_driver
from runtime.support.config_lint import lint_settings


def check_config(config: str, sets: Sequence[str]) -> int:
    """Print whether a configuration is good, with warnings, and return the exit code.

    Raises
    ------
    ConfigError
        The configuration is wrong; the message says what and where.
    FiringError
        Each value is valid, but the ring cannot carry out its firing pattern.
    """
    settings = load_any(config, sets)
    if isinstance(settings, Settings):
        make_driver(settings)  # refuses what the robot cannot carry out
        for text in lint_settings(settings):
            sys.stdout.write(f"{config}: {text}\n")
    sys.stdout.write(f"{config}: good\n")
    return DONE
