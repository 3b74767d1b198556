"""The robot of `echolocate init plugin`, as its package has it."""

from __future__ import annotations

import sys
import types
from typing import Any, Final

from config.load import parse_text
from config.robot import RobotConfig
from drivers.lines.wire import Wire
from runtime.cli.commands.init_plugin import FILES

NAME: Final = "skippy"
ROBOT: Final = parse_text(RobotConfig, FILES["robot"]["{name}/robots/{name}.toml"].format(name=NAME), NAME)


def family(text: str = FILES["robot"]["{name}/__init__.py"]) -> Any:
    """Return the package as a module."""
    module = types.ModuleType(NAME)
    sys.modules[NAME] = module  # pydantic looks for a class's module
    try:
        exec(compile(text.format(name=NAME), NAME, "exec"), module.__dict__)
    finally:
        del sys.modules[NAME]
    return module


def wire() -> Wire:
    """Return its lines."""
    return family().Lines(ROBOT)  # type: ignore[no-any-return]
