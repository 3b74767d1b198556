"""The reference of every key in a file: type, bounds, default and description, derived from the models themselves."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, Final, Literal, get_args, get_origin

import annotated_types
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from config.mission import MissionConfig
from config.model import ModelConfig
from config.plugins import DRIVERS, SCHEMAS, PluginError, plugged, plugged_table, plugged_use
from config.robot import RobotConfig
from config.settings import Settings
from config.strict import description, without_none
from config.study import StudyConfig
from config.toml_edit import inline
from config.world import WorldConfig

FILES: Final = (
    ("run", Settings, "run file, `echolocate run FILE`; the tables of a robot file may stand in it as well"),
    ("robot", RobotConfig, "robot file, `--robot FILE`"),
    ("world", WorldConfig, "world file, `--world FILE`, `--map FILE`"),
    ("model", ModelConfig, "object model, `--model FILE`"),
    ("mission", MissionConfig, "mission file, `--mission FILE`"),
    ("study", StudyConfig, "study file, `echolocate sweep FILE` or `echolocate tune FILE`"),
)
"""The kinds of files: name, model, and what each is for."""
PLAIN: Final = ((bool, "true or false"), (int, "integer"), (float, "number"), (str, "text"))


@dataclass(frozen=True, slots=True)
class Setting:
    """One key of a file."""

    file: str
    """Kind of file."""
    table: str
    """The table that holds it, as in ``behaviors.arbiter``; ``[]`` ends the name of a list of tables."""
    key: str
    type: str
    bounds: str
    default: str
    """As in TOML; empty if the key is required, ``not set`` if nothing stands for it."""
    help: str

    @property
    def path(self) -> str:
        """The whole name, as after ``--set``."""
        return f"{self.table}.{self.key}" if self.table else self.key


def settings_of(file: str) -> Iterator[Setting]:
    """Yield the keys of one kind of file, table by table; those of installed packages last.

    Those of a run file are its own: what describes the robot, the world and so on is listed with their files.

    `file` is a name of `FILES`.
    """
    model = next(model for name, model, _ in FILES if name == file)
    # A run file names these files, whose keys are listed with them.
    others = {*RobotConfig.model_fields, "models", "world", "known_room", "mission"}
    yield from _settings(file, model, "", others if model is Settings else set())
    for table, own in _plugged_tables(file).items():
        yield from _settings(file, own, table, set())


def _plugged_tables(file: str) -> dict[str, type[BaseModel]]:
    """Return what installed packages add to one kind of file, by the tables' names; a broken one adds nothing."""
    group, find, table = (
        (DRIVERS, plugged_table, "{}") if file == "robot" else (SCHEMAS, plugged_use, "step[].schemas[{}]")
    )
    tables = {}
    for name in plugged(group) if file in {"robot", "mission"} else ():
        with contextlib.suppress(PluginError):
            tables[table.format(name)] = find(name)
    return {name: found for name, found in tables.items() if found is not None}


def table_help(file: str, table: str) -> str:
    """Return what a table is for: the first paragraph of its model's documentation."""
    model: type[BaseModel] = next(model for name, model, _ in FILES if name == file)
    way = table
    for own_table, own in _plugged_tables(file).items():
        if f"{table}.".startswith(f"{own_table}."):
            model, way = own, table[len(own_table) + 1 :]
    for name in way.removesuffix("[]").split(".") if way else ():
        key, _, kind = name.removesuffix("]").partition("[")
        options = list(_models(model.model_fields[key].annotation))
        model = next((option for option in options if kind == _kind(option)), options[0])
    if not table:
        return ""
    return " ".join((model.__doc__ or "").split("\n\n")[0].split())


def _settings(file: str, model: type[BaseModel], table: str, leave_out: set[str]) -> Iterator[Setting]:
    """Return a table's own keys, then those of the tables in it."""
    fields = {name: field for name, field in model.model_fields.items() if name not in leave_out}
    own = {name: field for name, field in fields.items() if next(_models(field.annotation), None) is None}
    help_text = ""
    described = {}
    for name in reversed(own):  # one description after several keys is that of all of them
        help_text = " ".join((description(model, name) or help_text).split())
        described[name] = help_text
    for name, field in own.items():
        yield Setting(
            file, table, name, type_of(field.annotation), bounds_of(field), default_of(field), described[name]
        )
    for name, field in fields.items():
        inners = list(_models(field.annotation))
        for inner in inners:
            is_list = get_origin(without_none(field.annotation)[0]) in (tuple, list, Annotated)
            kind = _kind(inner) if len(inners) > 1 else ""
            inner_table = f"{table}.{name}".lstrip(".") + (f"[{kind}]" if is_list else "")
            yield from _settings(file, inner, inner_table, leave_out)


def _kind(model: type[BaseModel]) -> str:
    """Return the value of a table's first key that says which of several tables it is."""
    return str(next(iter(get_args(next(iter(model.model_fields.values())).annotation)), ""))


def _models(annotation: Any) -> Iterator[type[BaseModel]]:  # noqa: ANN401 - an annotation can be anything
    """Return the models within an annotation: one of a table, or of a list of tables."""
    for option in without_none(annotation):
        if isinstance(option, type) and issubclass(option, BaseModel):
            yield option
        elif get_origin(option) in (Annotated, tuple, list):
            yield from _models(get_args(option)[0])


def type_of(annotation: Any) -> str:  # noqa: ANN401 - an annotation can be anything
    """Return a type in words: its choices, a plain type, or a list."""
    options = without_none(annotation)
    if len(options) > 1:
        return " or ".join(type_of(option) for option in options)
    only = options[0]
    if get_origin(only) is Annotated:
        return type_of(get_args(only)[0])
    if get_origin(only) is Literal:
        return " or ".join(f'"{choice}"' if isinstance(choice, str) else str(choice) for choice in get_args(only))
    if get_origin(only) is tuple:
        inner = [part for part in get_args(only) if part is not ...]
        if ... in get_args(only):
            return f"list of {type_of(inner[0])}"
        return f"list of {len(inner)} × {type_of(inner[0])}"
    if get_origin(only) is list:
        return f"list of {type_of(get_args(only)[0])}"
    if get_origin(only) is dict:
        return f"table of {type_of(get_args(only)[1])}"
    return next((words for plain, words in PLAIN if only is plain), getattr(only, "__name__", str(only)))


def bounds_of(field: FieldInfo) -> str:
    """Return a field's bounds, as in ``> 0, ≤ 100``."""
    found = []
    for bound in field.metadata:
        match bound:
            case annotated_types.Ge(ge=value):
                found.append(f"≥ {value:g}")
            case annotated_types.Gt(gt=value):
                found.append(f"> {value:g}")
            case annotated_types.Le(le=value):
                found.append(f"≤ {value:g}")
            case annotated_types.Lt(lt=value):
                found.append(f"< {value:g}")
            case annotated_types.MinLen(min_length=value):
                found.append(f"at least {value} long")
            case annotated_types.MaxLen(max_length=value):
                found.append(f"at most {value} long")
    return ", ".join(found)


def default_of(field: FieldInfo) -> str:
    """Return a field's default as in TOML."""
    if field.is_required():
        return ""
    value = field.get_default(call_default_factory=True)
    return "not set" if value is None else inline(value)


def markdown() -> str:
    """Return the reference of all kinds of files as a page."""
    lines = [
        "# Settings",
        "",
        "Every key of every kind of file; `echolocate settings TEXT` finds one, and `echolocate settings --out FILE`",
        "writes this page. Lengths are metres, angles radians where the name does not say degrees. Unknown keys are",
        "errors. A key without a default is required where its table stands.",
    ]
    for file, _, purpose in FILES:
        lines += ["", f"## {file.capitalize()}: {purpose}"]
        table = None
        for setting in settings_of(file):
            if setting.table != table:
                table = setting.table
                name = f"[[{table.removesuffix('[]')}]]" if table.endswith("[]") else f"[{table}]"
                if table.endswith("]") and not table.endswith("[]"):  # one of several tables in a list
                    name = "[[{}]] {}".format(*table.replace("[]", "").removesuffix("]").split("["))
                title = f"`{name}`" if table else "Top of the file"
                lines += ["", f"### {title}", ""]
                lines += [text, ""] if (text := table_help(file, table)) else []
                lines += ["| key | value | default | meaning |", "|---|---|---|---|"]
            value = ", ".join(part for part in (setting.type, setting.bounds) if part)
            default = f"`{setting.default}`" if setting.default not in {"", "not set"} else setting.default
            cells = (f"`{setting.key}`", value, default, setting.help)
            lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(lines) + "\n"
