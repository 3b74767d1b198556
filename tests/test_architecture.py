"""The product keeps the rules of its house, and the reader of those rules would notice if it did not."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.architecture import LINES_MAX, ROOMS, house, violations

TOP = Path(__file__).resolve().parents[1]
WHY = '"""Why."""\n'


def found(path: str, source: str) -> list[str]:
    """What the reader says of one planted module among the real modules' names."""
    modules = {
        "drivers/messages.py": WHY,
        "drivers/link.py": WHY,
        "perception/percept.py": WHY,
        "config/load.py": WHY,
    }
    return [str(v) for v in violations({**modules, path: source})]


def test_the_house_is_in_order() -> None:
    sources = house(TOP)
    assert {path.split("/")[0] for path in sources} == set(ROOMS)
    assert "drivers/messages.py" in sources
    broken = violations(sources)
    assert not broken, "\n" + "\n".join(map(str, broken))


@pytest.mark.parametrize(
    ("path", "line", "complaint"),
    [
        ("config/x.py", "import drivers.messages", "imports drivers.messages, but config/ may know only config"),
        ("config/x.py", "from drivers import messages", "imports drivers.messages"),
        ("drivers/x.py", "from perception.percept import Percept", "imports perception.percept, but drivers/"),
        ("drivers/x.py", "import runtime", "imports runtime, but drivers/"),
        ("perception/x.py", "from drivers import link", "imports drivers.link, but perception/"),
        ("perception/x.py", "from drivers import messages, link", "imports drivers.link"),
        ("perception/x.py", "import drivers", "imports drivers, but perception/"),
        ("perception/x.py", "import drivers.messages_more", "imports drivers.messages_more, but perception/"),
        ("perception/x.py", "from behaviors.arbiter import Drive", "imports behaviors.arbiter, but perception/"),
        ("behaviors/x.py", "from drivers.messages import Pose", "imports drivers.messages, but behaviors/"),
        ("behaviors/x.py", "from perception.pipeline import step", "imports perception.pipeline, but behaviors/"),
        ("behaviors/x.py", "from perception import percept, secret", "imports perception, but behaviors/"),
        ("behaviors/x.py", "from .. import runtime", "imports runtime, but behaviors/"),
        ("behaviors/deep/x.py", "from ...drivers import link", "imports drivers.link, but behaviors/"),
        ("behaviors/x.py", "def f() -> None:\n    import runtime.cycle", "x.py:3: imports runtime.cycle"),
        ("behaviors/x.py", "if TYPE_CHECKING:\n    from runtime import cycle", "imports runtime, but behaviors/"),
        ("runtime/x.py", "from tests.naive import slow", "the product does not know its tests"),
        ("drivers/denning/x.py", "import asyncio", "imports asyncio, which belongs to"),
        ("config/x.py", "from asyncio import Queue", "imports asyncio, which belongs to"),
        ("drivers/denning/device.py", "import asyncio.events", "imports asyncio.events, which belongs to"),
        ("runtime/x.py", "import serial_asyncio", "imports serial_asyncio, which belongs to drivers/link.py"),
        ("runtime/x.py", "from importlib import import_module", "imports are written out"),
        ("runtime/x.py", "import importlib", "imports are written out"),
        ("runtime/x.py", "__import__('drivers')", "calls __import__"),
        ("perception/x.py", "import time", "imports time, but perception/ is pure"),
        ("perception/x.py", "from os import path", "imports os, but perception/ is pure"),
        ("perception/x.py", "from pathlib import Path", "imports pathlib, but perception/ is pure"),
        ("behaviors/x.py", "import random as dice", "imports random, but behaviors/ is pure"),
        ("behaviors/x.py", "import logging.config", "imports logging.config, but behaviors/ is pure"),
        ("behaviors/x.py", "import structlog", "imports structlog, but behaviors/ is pure"),
        ("behaviors/x.py", "from io import StringIO", "imports io, but behaviors/ is pure"),
        ("perception/x.py", "import asyncio", "imports asyncio, but perception/ is pure"),
        ("perception/x.py", "def f():\n    print(1)", "x.py:3: calls print, but perception/ is pure"),
        ("behaviors/x.py", "open('f')", "calls open, but behaviors/ is pure"),
        ("perception/x.py", "r = np.random.normal()", "randomness comes in as an argument"),
        ("perception/x.py", "r = numpy.random.default_rng()", "randomness comes in as an argument"),
        ("config/x.py", "CACHE = {}", "keeps the mutable global CACHE"),
        ("config/x.py", "CACHE: Final[list[int]] = [1]", "keeps the mutable global CACHE"),
        ("drivers/x.py", "SEEN = set()", "keeps the mutable global SEEN"),
        ("drivers/x.py", "A = B = [i for i in range(3)]", "keeps the mutable global A, B"),
        ("drivers/x.py", "Q = collections.deque(maxlen=3)", "keeps the mutable global Q"),
        ("drivers/x.py", "PAIR = (1, [])", "keeps the mutable global PAIR"),
        ("runtime/x.py", "try:\n    X = {1}\nexcept OSError:\n    pass", "keeps the mutable global X"),
        ("runtime/x.py", "def f():\n    global n\n    n = 1", "rebinds the global n"),
        ("runtime/x.py", "X = 1\n" * LINES_MAX, f"is {LINES_MAX + 2} lines long, {LINES_MAX} at most"),
    ],
)
def test_notices_a_planted_violation(path: str, line: str, complaint: str) -> None:
    said = found(path, f"{WHY}{line}\n")
    assert said
    assert all(text.startswith(path) for text in said)
    assert any(complaint in text for text in said), said


@pytest.mark.parametrize("source", ["", "x = 1\n", "# a comment is none\n"])
def test_notices_a_missing_docstring(source: str) -> None:
    assert found("config/x.py", source) == ["config/x.py:1: has no docstring to say why it exists"]


@pytest.mark.parametrize(
    ("path", "line"),
    [
        (
            "config/x.py",
            "from config.load import load\nfrom pathlib import Path\nfrom importlib.resources import files",
        ),
        ("config/x.py", "from importlib import resources\nfrom importlib.util import find_spec"),
        ("drivers/x.py", "from config.robot import RingConfig\nfrom . import link\nimport time, logging"),
        (
            "perception/x.py",
            "from drivers import messages\nfrom drivers.messages import Pose\nimport config, math, numba",
        ),
        ("perception/x.py", "def f(r: np.random.Generator) -> float:\n    return r.normal()"),
        (
            "behaviors/x.py",
            "from perception import percept\nfrom .other import f\nfrom perception.percept import Percept",
        ),
        ("runtime/x.py", "import asyncio, behaviors.arbiter, drivers.denning.codec\nprint(open)"),
        ("drivers/link.py", "import asyncio\nimport serial_asyncio"),
        ("drivers/emulator/pty_transport.py", "import asyncio"),
        ("drivers/x.py", "__all__ = ['a']\nTABLE: Final = (1, 2)\nNAMES = frozenset({1})\nT = MappingProxyType({})"),
        ("drivers/x.py", "def f():\n    local = []\n    return local\nclass C:\n    slots = ('a',)"),
        ("runtime/x.py", "X = 1\n" * (LINES_MAX - 2)),
    ],
)
def test_leaves_the_law_abiding_alone(path: str, line: str) -> None:
    assert found(path, f"{WHY}{line}\n") == []
