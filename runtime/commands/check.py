"""`echolocate check`: says whether a configuration is good."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from config.load import load_any
from config.settings import Settings
from runtime.advice import advice
from runtime.commands.firing import refuse_impossible_firing
from runtime.complaint import DONE


def check_config(config: str, sets: Sequence[str]) -> int:
    """Carry out the command; see `runtime.cli.check`.

    Raises
    ------
    ConfigError
        What is wrong, and where.
    Complaint
        Every value is good by itself, but the ring cannot fire so.
    """
    settings = load_any(config, sets)
    if isinstance(settings, Settings):
        refuse_impossible_firing(settings.ring)
        for text in advice(settings):
            sys.stdout.write(f"{config}: {text}\n")
    sys.stdout.write(f"{config}: good\n")
    return DONE
