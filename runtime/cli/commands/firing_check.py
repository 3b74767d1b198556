"""Refuse robot files, valid by schema, that no driver can carry out."""

from __future__ import annotations

from config.robot import RobotConfig
from drivers.registry import make_driver


def refuse_impossible_firing(config: RobotConfig) -> None:
    """Raise the `config.errors.UserError` of `drivers.registry.make_driver` if no driver can carry out `config`."""
    make_driver(config)
