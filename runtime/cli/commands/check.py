"""`echolocate check`: says whether a configuration is good."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from config.errors import DONE
from config.load import load_any
from config.settings import Settings
from runtime.cli.commands.firing_check import refuse_impossible_firing
from runtime.support.config_lint import lint_settings


def check_config(config: str, sets: Sequence[str]) -> int:
    """Carry out the command; see `runtime.cli.app.check`.

    Raises
    ------
    ConfigError
        What is wrong, and where.
    FiringError
        Each value is valid, but the ring cannot carry out its firing pattern.
    """
    settings = load_any(config, sets)
    if isinstance(settings, Settings):
        refuse_impossible_firing(settings)
        for text in lint_settings(settings):
            sys.stdout.write(f"{config}: {text}\n")
    sys.stdout.write(f"{config}: good\n")
    return DONE
