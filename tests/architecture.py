"""The rules of the house as a program: who may import whom, what is pure, how long a module may be.

It reads source text and imports nothing, so that a rule can be tried on a few planted lines as well.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

ROOMS: Final = ("config", "drivers", "perception", "behaviors", "runtime")

MAY_KNOW: Final = {
    "config": ("config",),
    "drivers": ("drivers", "config"),
    "perception": ("perception", "config", "drivers.messages"),
    "behaviors": ("behaviors", "config", "perception.percept"),
    "runtime": ROOMS,
}
"""For each room the modules of ours it may import, with all that is below them."""

PURE: Final = ("perception", "behaviors")
IMPURE_MODULES: Final = frozenset(
    {
        "asyncio",
        "concurrent",
        "ctypes",
        "datetime",
        "io",
        "logging",
        "multiprocessing",
        "os",
        "pathlib",
        "queue",
        "random",
        "secrets",
        "select",
        "shutil",
        "signal",
        "socket",
        "sqlite3",
        "structlog",
        "subprocess",
        "sys",
        "tempfile",
        "threading",
        "time",
        "uuid",
    }
)
IMPURE_CALLS: Final = frozenset({"print", "open", "input", "exec", "eval"})

MAY_AWAIT: Final = ("runtime/", "drivers/link.py", "drivers/emulator/pty_transport.py")
SERIAL_DOOR: Final = "drivers/link.py"
LINES_MAX: Final = 400

MUTABLE_LITERALS: Final = (ast.List, ast.Dict, ast.Set, ast.ListComp, ast.DictComp, ast.SetComp)
MUTABLE_CALLS: Final = frozenset(
    {
        "list",
        "dict",
        "set",
        "bytearray",
        "defaultdict",
        "deque",
        "Counter",
        "OrderedDict",
        "ChainMap",
        "SimpleNamespace",
    }
)


@dataclass(frozen=True)
class Violation:
    """One broken rule, where and which."""

    path: str
    line: int
    text: str

    def __str__(self) -> str:
        return f"{self.path}:{self.line}: {self.text}"


def house(top: Path) -> dict[str, str]:
    """Return the source of every module in the five rooms by its path from the top, with / between folders."""
    files = sorted(file for room in ROOMS for file in (top / room).rglob("*.py"))
    return {file.relative_to(top).as_posix(): file.read_text(encoding="utf-8") for file in files}


def violations(sources: dict[str, str]) -> list[Violation]:
    """Return every rule broken by these modules, given as source text by path."""
    known = frozenset(_module(path) for path in sources)
    return [v for path, source in sources.items() for v in _of_module(path, source, known)]


def _of_module(path: str, source: str, known: frozenset[str]) -> Iterator[Violation]:
    tree = ast.parse(source, path)
    if ast.get_docstring(tree) is None:
        yield Violation(path, 1, "has no docstring to say why it exists")
    if (lines := source.count("\n")) > LINES_MAX:
        yield Violation(path, lines, f"is {lines} lines long, {LINES_MAX} at most")
    for line, target in _imports(tree, path, known):
        yield from _of_import(path, line, target)
    yield from _of_calls(tree, path)
    yield from _of_globals(tree, path)


def _module(path: str) -> str:
    return path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


def _imports(tree: ast.Module, path: str, known: frozenset[str]) -> Iterator[tuple[int, str]]:
    """Yield line and dotted name of all that is imported, wherever in the module it is.

    `from a import b` counts as a.b where that is a module of ours, so that a room cannot be passed through its door.
    """
    package = path.split("/")[:-1]
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) - node.level + 1] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            for alias in node.names:
                whole = f"{base}.{alias.name}" if base else alias.name
                yield node.lineno, whole if whole in known or base in ("", "importlib") else base


def _of_import(path: str, line: int, target: str) -> Iterator[Violation]:
    room, first = path.split("/")[0], target.split(".")[0]
    if first == "tests":
        yield Violation(path, line, f"imports {target}: the product does not know its tests")
    if first in ROOMS and not any(target == door or target.startswith(f"{door}.") for door in MAY_KNOW[room]):
        yield Violation(path, line, f"imports {target}, but {room}/ may know only {', '.join(MAY_KNOW[room])}")
    if first == "asyncio" and not path.startswith(MAY_AWAIT):
        yield Violation(path, line, f"imports {target}, which belongs to {', '.join(MAY_AWAIT)}")
    if first.startswith("serial_asyncio") and path != SERIAL_DOOR:
        yield Violation(path, line, f"imports {target}, which belongs to {SERIAL_DOOR}")
    if room in PURE and first in IMPURE_MODULES:
        yield Violation(path, line, f"imports {target}, but {room}/ is pure")
    if target in {"importlib", "importlib.import_module"}:
        yield Violation(path, line, f"imports {target}: imports are written out, so that they can be checked")


def _of_calls(tree: ast.Module, path: str) -> Iterator[Violation]:
    room = path.split("/")[0]
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        called = ast.unparse(node.func)
        if called == "__import__":
            yield Violation(
                path, node.lineno, "calls __import__: imports are written out, so that they can be checked"
            )
        if room in PURE and called in IMPURE_CALLS:
            yield Violation(path, node.lineno, f"calls {called}, but {room}/ is pure")
        seeded = called.endswith(".default_rng") and bool(node.args or node.keywords)
        if room in PURE and called.startswith(("np.random.", "numpy.random.")) and not seeded:
            yield Violation(path, node.lineno, f"calls {called}: randomness comes in as an argument")


def _of_globals(tree: ast.Module, path: str) -> Iterator[Violation]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Global):
            yield Violation(path, node.lineno, f"rebinds the global {', '.join(node.names)}")
    for statement in _module_level(tree.body):
        if not isinstance(statement, ast.Assign | ast.AnnAssign | ast.AugAssign) or statement.value is None:
            continue
        targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
        names = ", ".join(ast.unparse(target) for target in targets)
        if names != "__all__" and _is_mutable(statement.value):
            yield Violation(path, statement.lineno, f"keeps the mutable global {names}")


def _module_level(body: list[ast.stmt]) -> Iterator[ast.stmt]:
    """Yield the statements that run when the module is imported, those under if, try and with among them."""
    for statement in body:
        yield statement
        if isinstance(statement, ast.If | ast.Try | ast.With | ast.For | ast.While):
            for part in ("body", "orelse", "finalbody"):
                yield from _module_level(getattr(statement, part, []))
            for handler in getattr(statement, "handlers", []):
                yield from _module_level(handler.body)


def _is_mutable(value: ast.expr) -> bool:
    if isinstance(value, ast.Call):
        return ast.unparse(value.func).split(".")[-1] in MUTABLE_CALLS
    if isinstance(value, ast.Tuple):
        return any(map(_is_mutable, value.elts))
    return isinstance(value, MUTABLE_LITERALS)
