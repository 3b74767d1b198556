"""The types of the console's page, made from the message models and from its HTML: `python -m tests.page_types`.

They are what `.ci/page/page.d.ts` builds on: the messages of a run by their types, the arguments and the answer of
each command, and the element of each id.
"""

from __future__ import annotations

import types
from collections.abc import Iterable, Iterator, Mapping, Sequence
from html.parser import HTMLParser
from pathlib import Path
from typing import (
    Annotated,
    Any,
    Final,
    Literal,
    NotRequired,
    Union,
    get_args,
    get_origin,
    get_type_hints,
    is_typeddict,
)

from pydantic import BaseModel

from runtime.bridges.fleet import FleetRow
from runtime.console import sent_messages
from runtime.console.commands.command import AnsweredLater
from runtime.console.commands.messages import wire_model
from runtime.console.commands.registry import COMMANDS
from runtime.console.frames import state_message

ROOT: Final = Path(__file__).resolve().parents[1]
PAGE: Final = ROOT / "runtime" / "console" / "page"
FILE: Final = ROOT / ".ci" / "page" / "messages.d.ts"
HEADER: Final = "// Made from the message models and the page's HTML by `python -m tests.page_types`.\n"
PLAIN: Final[Mapping[object, str]] = types.MappingProxyType(
    {
        float: "number",
        int: "number",
        str: "string",
        bool: "boolean",
        type(None): "null",
        object: "unknown",
    }
)
ELEMENTS: Final = types.MappingProxyType({
    "a": "HTMLAnchorElement", "button": "HTMLButtonElement", "canvas": "HTMLCanvasElement",
    "dialog": "HTMLDialogElement", "form": "HTMLFormElement", "input": "HTMLInputElement",
    "output": "HTMLOutputElement", "progress": "HTMLProgressElement", "select": "HTMLSelectElement",
    "textarea": "HTMLTextAreaElement", "svg": "SVGSVGElement", "use": "SVGUseElement",
})  # fmt: skip
"""The interface of each tag; that of others is HTMLElement."""
ENVELOPE: Final = frozenset({"id", "type", "challenge"})
"""What every command has besides its arguments."""
ONE_LINE_MAX: Final = 100
"""Characters of a declaration on one line."""


class Declarations:
    """TypeScript declarations of Python types, each declared once under its own name."""

    def __init__(self) -> None:
        self._declared: dict[str, str] = {}
        self._classes: dict[str, type] = {}

    def __str__(self) -> str:
        return "\n".join(self._declared.values())

    def name(self, of: Any) -> str:
        """Return the TypeScript type of what a value of a Python type is in JSON.

        Raises
        ------
        TypeError
            The type has no form in JSON that is known here, or its name is that of another one.
        """
        if of in PLAIN:
            return PLAIN[of]
        origin, given = get_origin(of), get_args(of)
        if origin is Annotated:
            shown = next((one for one in given[1:] if isinstance(one, type) or get_origin(one) is not None), given[0])
            return self.name(shown)
        if origin is NotRequired or (isinstance(origin, type) and issubclass(origin, AnsweredLater)):
            return self.name(given[0])
        if origin is Literal:
            return " | ".join(f'"{one}"' for one in given)
        if origin in {Union, types.UnionType}:
            return " | ".join(dict.fromkeys(self.name(one) for one in given))
        if origin is dict:
            return f"Record<{self.name(given[0])}, {self.name(given[1])}>"
        if origin is tuple and given[-1] is not ...:
            return f"[{', '.join(self.name(one) for one in given)}]"
        if origin in {list, tuple}:
            return f"Array<{self.name(given[0])}>"
        return self._declare(of)

    def _declare(self, of: type) -> str:
        """Declare a class of named fields, unless it is declared already, and return its name."""
        if self._classes.setdefault(of.__name__, of) is not of:
            raise TypeError(f"two types are named {of.__name__}: rename one of them")
        if of.__name__ in self._declared:
            return of.__name__
        self._declared[of.__name__] = ""  # keeps its place before the types of its fields
        said = (of.__doc__ or "").partition("\n")[0]
        if is_typeddict(of):
            hints = get_type_hints(of, include_extras=True)
            body = self.fields(hints, {key for key, hint in hints.items() if get_origin(hint) is NotRequired})
        elif issubclass(of, BaseModel):
            body = self.fields({name: _hint(of, name) for name in of.model_fields})
        elif issubclass(of, tuple):
            parts = "".join(f"  {key}: {self.name(hint)},\n" for key, hint in get_type_hints(of).items())
            self._declared[of.__name__] = f"/** {said} */\ntype {of.__name__} = [\n{parts}];\n"
            return of.__name__
        else:
            raise TypeError(f"{of} has no form in JSON that is known here")
        comment = f"/** {said} */\n" if said else ""
        self._declared[of.__name__] = f"{comment}interface {of.__name__} {body}\n"
        return of.__name__

    def fields(self, hints: Mapping[str, Any], optional: Iterable[str] = ()) -> str:
        """Return the fields of an object."""
        lines = [f"  {key}{'?' if key in optional else ''}: {self.name(hint)};" for key, hint in hints.items()]
        return "\n".join(("{", *(_broken(line) for line in lines), "}"))


def _broken(line: str) -> str:
    """Return a line in several, a member of its union on each, if it is too long."""
    return line if len(line) <= ONE_LINE_MAX else line.replace(" | [", "\n    | [")


def _hint(model: type[BaseModel], name: str) -> Any:
    return model.model_fields[name].annotation


def page_types() -> str:
    """Return the declarations, as the file has them."""
    made = Declarations()
    arguments, answers = list[str](), list[str]()
    for name, command in COMMANDS.items():
        arguments.append(f"  {name}: {_arguments(made, name, command.type)};")
        answers.append(f"  {name}: {made.name(get_type_hints(command.handler, include_extras=True)['return'])};")
    parts = [
        f"/** What a run sends, by its type. */\ninterface Messages {made.fields(message_types())}\n",
        _interface("Commands", "The arguments of each command.", arguments),
        _interface("Answers", "The data of the answer to each command.", answers),
        _interface("PageElements", "The elements of the pages, by their id.", _elements()),
    ]
    made.name(FleetRow)
    return "\n".join((HEADER, *parts, str(made)))


def _arguments(made: Declarations, name: str, of: type) -> str:
    wire = {key: field for key, field in wire_model(name, of).model_fields.items() if key not in ENVELOPE}
    optional = {key for key, field in wire.items() if not field.is_required()}
    text = made.fields({key: field.annotation for key, field in wire.items()}, optional)
    one_line = " ".join(line.strip() for line in text.split("\n"))
    return one_line if len(one_line) <= ONE_LINE_MAX else text.replace("\n", "\n  ")


def _interface(name: str, said: str, lines: Iterable[str]) -> str:
    return "\n".join((f"/** {said} */", f"interface {name} {{", *lines, "}\n"))


def message_types() -> dict[str, type]:
    """Return the typed dictionary of each message, by the message's `type`."""
    known = [*vars(state_message).values(), *vars(sent_messages).values()]
    messages = [one for one in known if is_typeddict(one) and one.__name__.endswith("Message")]
    return {str(get_args(get_type_hints(one)["type"])[0]): one for one in messages}


def shape_error(message: Mapping[str, Any]) -> str | None:
    """Return which fields of a message are unknown or missing, None if it has those of its type."""
    hints = get_type_hints(message_types()[message["type"]], include_extras=True)
    needed = {key for key, hint in hints.items() if get_origin(hint) is not NotRequired}
    unknown, missing = message.keys() - hints.keys(), needed - message.keys()
    return f"{message['type']}: unknown {unknown}, missing {missing}" if unknown or missing else None


def _elements() -> Iterator[str]:
    found: dict[str, str] = {}
    for file in sorted(PAGE.glob("*.html")):
        reader = _Ids()
        reader.feed(file.read_text("utf-8"))
        found |= reader.found
    yield from (f'  "{name}": {found[name]};' for name in sorted(found))


class _Ids(HTMLParser):
    """Collects the interface of each element that has an id."""

    def __init__(self) -> None:
        super().__init__()
        self.found: dict[str, str] = {}

    def handle_starttag(self, tag: str, attrs: Sequence[tuple[str, str | None]]) -> None:
        """Take in a tag."""
        name = dict(attrs).get("id")
        if name is not None and tag != "symbol":
            self.found[name] = ELEMENTS.get(tag, "HTMLElement")


if __name__ == "__main__":
    FILE.write_text(page_types(), "utf-8")
