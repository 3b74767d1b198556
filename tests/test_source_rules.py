"""Rules on the source that neither ruff nor import-linter can state: length, mutable globals, pure calls, tests.

The import rules are contracts in pyproject.toml. Two of them have to list every module but one; a test here compares
those lists with the packages, so that a new module cannot slip through.
"""

from __future__ import annotations

import ast
import tomllib
from collections.abc import Iterator
from pathlib import Path
from types import MappingProxyType
from typing import Final

import pytest

from drivers.contract.plugin import PARTS
from drivers.registry import SHIPPED
from runtime.cli.app import COMMANDS, place_of

ROOT: Final = Path(__file__).resolve().parents[1]
PACKAGES: Final = ("config", "drivers", "perception", "behaviors", "runtime")
PURE: Final = ("perception/", "behaviors/")
LINES_MAX: Final = 400
COMPLEXITY_MAX: Final = 20
"""Of a function, as radon counts it: 1, and 1 for each branch, loop, handler, `and` and `or`. Of its arguments ruff
takes care (PLR0913)."""
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
MODULES: Final = {
    file.relative_to(ROOT).as_posix(): file.read_text("utf-8")
    for package in PACKAGES
    for file in sorted((ROOT / package).rglob("*.py"))
}

WITHOUT_TEST: Final = MappingProxyType(
    {
        "behaviors/response.py": "one dataclass",
        "behaviors/schema_call.py": "dataclasses",
        "config/units.py": "one constant",
        "drivers/arcos/frames.py": "dataclasses and constants",
        "drivers/rflex/diagnostics.py": "messages",
        "perception/bayes/memory/job_records.py": "records and constants",
        "perception/localization/drift/landmark_state.py": "records and constants",
        "perception/localization/localized_pose.py": "one record",
        "perception/mapping/surfaces/parameters.py": "constants",
        "perception/mapping/surfaces/records.py": "records",
        "perception/shared_numbers.py": "constants",
        "runtime/console/commands/command.py": "dataclasses and an enumeration",
        "runtime/console/commands/command_error.py": "an exception with one attribute",
        "runtime/console/frames/state_message.py": "typed dictionaries",
        "runtime/console/protocols.py": "protocol classes",
        "runtime/console/sent_messages.py": "typed dictionaries",
        "runtime/cycle/callbacks.py": "constants",
        "runtime/recording/replay_summary.py": "typed dictionaries",
        "runtime/simulation/scene_names.py": "one type",
        "runtime/timing/phases.py": "an enumeration",
    }
)
"""Modules of pure declarations, which need no test of their own, with what they declare."""

TESTED_ELSEWHERE: Final = MappingProxyType(
    {
        "tests/drivers/firmware runs them in the real MicroPython": (
            "drivers/firmware/board/main.py",
            "drivers/firmware/board/ring/base.py",
            "drivers/firmware/board/ring/build.py",
            "drivers/firmware/board/ring/clock.py",
            "drivers/firmware/board/ring/firing.py",
            "drivers/firmware/board/ring/i2c_sensors.py",
            "drivers/firmware/board/ring/irq.py",
            "drivers/firmware/board/ring/pio.py",
            "drivers/firmware/board/ring/pulse_sensors.py",
            "drivers/firmware/board/ring/robot.py",
            "drivers/firmware/board/ring/scan.py",
            "drivers/firmware/board/ring/uart_line.py",
            "drivers/firmware/board/ring/usb_line.py",
            "drivers/firmware/board/ring/wheel.py",
            "drivers/firmware/board/ring/wire.py",
            "drivers/firmware/board/robot_config_esp32.py",
            "drivers/firmware/board/robot_config_pico.py",
        ),
        "tests/runtime/cli/commands/test_init_files.py calls its commands": ("runtime/cli/commands/init.py",),
        "the contract of drivers drives everything through it": ("drivers/contract/cable.py",),
        "`make ros2` runs it beside real nodes, see test_real_nodes.py": (
            "drivers/ros2/gateway.py",
            "runtime/bridges/ros2/bridge.py",
            "runtime/bridges/ros2/node.py",
            "runtime/bridges/ros2/robot_listener.py",
        ),
    }
)
"""Modules that no test at the mirrored path can run, by what runs them."""


def violations(path: str, source: str) -> Iterator[str]:
    """Yield each rule that a module breaks, with its line."""
    if (lines := source.count("\n")) > LINES_MAX:
        yield f"{path}: {lines} lines; at most {LINES_MAX} are allowed"
    tree = ast.parse(source, path)
    for statement in module_level(tree.body):
        if isinstance(statement, ast.Assign | ast.AnnAssign | ast.AugAssign) and is_mutable(statement.value):
            names = ast.unparse(statement.targets[0] if isinstance(statement, ast.Assign) else statement.target)
            if names != "__all__":
                yield f"{path}:{statement.lineno}: mutable global {names}"
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and path.startswith(PURE) and is_impure(node):
            yield f"{path}:{node.lineno}: impure call {ast.unparse(node.func)}"
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and (n := complexity(node)) > COMPLEXITY_MAX:
            yield f"{path}:{node.lineno}: {node.name} has a complexity of {n}; at most {COMPLEXITY_MAX} is allowed"


def module_level(body: list[ast.stmt]) -> Iterator[ast.stmt]:
    """Yield the statements that run on import, also those inside if, try, with and loops."""
    for statement in body:
        yield statement
        if isinstance(statement, ast.If | ast.Try | ast.With | ast.For | ast.While):
            for part in ("body", "orelse", "finalbody"):
                yield from module_level(getattr(statement, part, []))
            for handler in getattr(statement, "handlers", []):
                yield from module_level(handler.body)


def is_mutable(value: ast.expr | None) -> bool:
    """Return whether a module-level value can change after import."""
    if isinstance(value, ast.Call):
        return ast.unparse(value.func).split(".")[-1] in MUTABLE_CALLS
    if isinstance(value, ast.Tuple):
        return any(map(is_mutable, value.elts))
    return isinstance(value, MUTABLE_LITERALS)


def is_impure(call: ast.Call) -> bool:
    """Return whether a call does I/O, runs text as code, or draws from an unseeded random generator."""
    name = ast.unparse(call.func)
    is_seeded = name.endswith(".default_rng") and bool(call.args or call.keywords)
    is_random = name.startswith(("np.random.", "numpy.random.")) and not is_seeded
    return is_random or name in {"print", "open", "input", "exec", "eval", "__import__"}


@pytest.mark.parametrize("path", MODULES)
def test_module_keeps_the_rules(path: str) -> None:
    assert list(violations(path, MODULES[path])) == []


@pytest.mark.parametrize(
    ("path", "source", "expected"),
    [
        ("config/x.py", "CACHE = {}", "x.py:1: mutable global CACHE"),
        ("config/x.py", "CACHE: Final[list[int]] = [1]", "mutable global CACHE"),
        ("drivers/x.py", "SEEN = set()", "mutable global SEEN"),
        ("drivers/x.py", "A = B = [i for i in range(3)]", "mutable global A"),
        ("drivers/x.py", "Q = collections.deque(maxlen=3)", "mutable global Q"),
        ("drivers/x.py", "PAIR = (1, [])", "mutable global PAIR"),
        ("runtime/x.py", "try:\n    X = {1}\nexcept OSError:\n    pass", "x.py:2: mutable global X"),
        ("perception/x.py", "def f():\n    print(1)", "x.py:2: impure call print"),
        ("behaviors/x.py", "open('f')", "impure call open"),
        ("perception/x.py", "r = np.random.normal()", "impure call np.random.normal"),
        ("perception/x.py", "r = numpy.random.default_rng()", "impure call numpy.random.default_rng"),
        ("runtime/x.py", "X = 1\n" * (LINES_MAX + 1), "401 lines; at most 400"),
        ("runtime/x.py", "def f():\n" + 20 * "  if a: pass\n", "x.py:1: f has a complexity of 21; at most 20"),
    ],
)
def test_violation_is_found(path: str, source: str, expected: str) -> None:
    (found,) = violations(path, source)
    assert expected in found


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("drivers/x.py", "__all__ = ['a']\nTABLE: Final = (1, 2)\nNAMES = frozenset({1})\nT = MappingProxyType({})"),
        ("drivers/x.py", "def f():\n    local = []\n    return local\nclass C:\n    slots = ('a',)"),
        ("perception/x.py", "def f(r: np.random.Generator) -> float:\n    return r.normal()"),
        ("perception/x.py", "rng = np.random.default_rng(7)"),
        ("runtime/x.py", "print(open)"),
        ("runtime/x.py", "X = 1\n" * LINES_MAX),
    ],
)
def test_allowed_code_is_accepted(path: str, source: str) -> None:
    assert list(violations(path, source)) == []


def mirrored(path: str) -> Path:
    """Return the path of the test of a module."""
    module = ROOT / "tests" / path
    return module.with_name(f"test_{module.name}")


def test_every_module_has_a_test_at_the_mirrored_path() -> None:
    modules = {path for path in MODULES if Path(path).name not in {"__init__.py", "__main__.py"}}
    assert modules >= WITHOUT_TEST.keys(), "a module that does not exist"
    tested = {path for path in modules if mirrored(path).exists()}
    elsewhere = {path for paths in TESTED_ELSEWHERE.values() for path in paths}
    assert not modules - tested - WITHOUT_TEST.keys() - elsewhere
    assert not tested & (WITHOUT_TEST.keys() | elsewhere), "it has a test of its own by now"


def named_modules(path: str, source: str) -> Iterator[str]:
    """Yield the modules that a module imports, or names in a text as `module` or `module:function`."""
    for node in ast.walk(ast.parse(source, path)):
        if isinstance(node, ast.ImportFrom) and node.module is not None:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value.partition(":")[0]


def test_every_module_is_reached_from_an_entry_point() -> None:
    """Tests and measurements alone are no reason for a module of the product; firmware is read as files."""
    modules = {path.removesuffix(".py").removesuffix("/__init__").replace("/", "."): path for path in MODULES}
    sources = {name: MODULES[path] for name, path in modules.items() if "firmware/board/" not in path}
    left = ["runtime.cli.__main__", "runtime.cli.terminal.__main__"]
    for library in ("echolocate.py", "echolocate_pytest.py"):
        left += named_modules(library, (ROOT / library).read_text("utf-8"))
    left += [family.module for family in SHIPPED.values()]
    left += [f"drivers.contract.{part}" for part in PARTS]
    left += ["drivers.lines.driver", "drivers.lines.device"]  # what the packages of `init plugin` are made of
    left += [place_of(name).partition(":")[0] for commands in COMMANDS.values() for name in commands]
    reached: set[str] = set()
    while left:
        name = left.pop()
        if name in sources and name not in reached:
            reached.add(name)
            left += [*named_modules(name, sources[name]), name.rpartition(".")[0]]
    assert sources.keys() - reached == set()


@pytest.mark.parametrize(
    ("contract", "package", "allowed"),
    [
        ("perception-drivers", "drivers", {"drivers.messages"}),
        ("behaviors-perception", "perception", {"perception.kernel", "perception.percept"}),
    ],
)
def test_contract_lists_every_other_module(contract: str, package: str, allowed: set[str]) -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    (rule,) = (one for one in project["tool"]["importlinter"]["contracts"] if one["id"] == contract)
    children = {path.removesuffix(".py").split("/")[1] for path in MODULES if path.startswith(f"{package}/")}
    expected = {f"{package}.{child}" for child in children - {"__init__"}} - allowed
    assert set(rule["forbidden_modules"]) == expected


def complexity(function: ast.AST) -> int:
    """Return the cyclomatic complexity of a function, of the functions in it included."""
    total = 1
    for node in ast.walk(function):
        if isinstance(node, ast.BoolOp):
            total += len(node.values) - 1
        elif isinstance(node, ast.comprehension):
            total += 1 + len(node.ifs)
        elif isinstance(node, ast.Try):
            total += len(node.handlers) + bool(node.orelse)
        elif isinstance(node, ast.For | ast.While | ast.AsyncFor):
            total += 1 + bool(node.orelse)
        elif isinstance(node, ast.Match):
            total += len(node.cases)
        elif isinstance(node, ast.If | ast.IfExp | ast.Assert | ast.Lambda):
            total += 1
    return total


def test_a_number_of_perception_has_its_name_alone() -> None:
    """A reader who meets a name of another module must not have to ask which of two values it is."""
    values = dict[str, set[str]]()
    for path, source in MODULES.items():
        for node in ast.parse(source, path).body if path.startswith("perception/") else ():
            if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name) and node.value is not None:
                value = ast.unparse(node.value)
                if ast.unparse(node.annotation) == "Final" and any(letter.isdigit() for letter in value):
                    values.setdefault(node.target.id, set()).add(value)
    assert len(values) > 500
    assert {name: sorted(of) for name, of in values.items() if len(of) > 1} == {}


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("return x", 1),
        ("if a and b or c: pass\nelif d: pass", 5),
        ("for a in b:\n  while c: pass\nelse: pass", 4),
        ("try: pass\nexcept A: pass\nexcept B: pass", 3),
        ("return [a if b else c for a in d if a]", 4),
    ],
)
def test_branches_are_counted(source: str, expected: int) -> None:
    lines = "\n".join(f"    {line}" for line in source.split("\n"))
    assert complexity(ast.parse(f"def f():\n{lines}").body[0]) == expected
