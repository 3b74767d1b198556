"""The files of this run's settings: their text, what is wrong with a changed one, its difference, and saving it."""

from __future__ import annotations

import asyncio
import contextlib
import difflib
import hashlib
from collections.abc import Callable, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Final

from config.errors import UserError
from config.files import ConfigError, DocumentRead, in_place_of, read_file, read_shipped
from config.load import parse_text, with_room
from config.settings import Settings
from config.toml_edit import TomlValue
from config.toml_lines import located
from config.world import WorldConfig
from runtime.analysis.export.world_file import text_with_places, with_places, world_text
from runtime.console.commands.command_error import CommandError
from runtime.console.files.settings_form import form_of, with_setting
from runtime.console.sent_messages import ProblemRow, SettingsCheck, SettingsRow, SettingsText
from runtime.support.config_lint import lint_settings
from runtime.support.user_folders import kept_places
from runtime.support.whole_file import whole_file

KINDS: Final = MappingProxyType(
    {"runs": "run", "robots": "robot", "worlds": "world", "models": "model", "missions": "mission"}
)
"""Kinds of files as the page names them."""
HEAD: Final = "The places of the map {}, kept for the next run with it (m)."


class SettingsFiles:
    """The files that the settings of this run were read from.

    `settings` are those with which the run began; `reload` reads those of the whole run again, and raises ConfigError
    where they are wrong; `restart` ends the run and starts it again with the same command, or returns why it cannot.
    """

    def __init__(
        self,
        documents: Sequence[DocumentRead],
        settings: Settings,
        reload: Callable[[], Settings],
        restart: Callable[[], str | None],
    ) -> None:
        self._documents = [one for one in documents if one.kind in KINDS]
        self._reload = reload
        self._restart = restart
        self._keeping = asyncio.Lock()
        self._settings = settings
        self._map: tuple[WorldConfig | None, DocumentRead | None] = (
            settings.perception.localization.known_room,
            None,
        )
        """A known room, and the file that had it when that was last looked at."""

    def listed(self) -> list[SettingsRow]:
        """Return the files, in the order in which they were read."""
        return [{"kind": KINDS[d.kind], "name": d.name, "shipped": d.path is None} for d in self._documents]

    async def read(self, number: int) -> SettingsText:
        """Return the text of a file by its number in the list.

        Raises
        ------
        CommandError
            There is no such file, or it cannot be read.
        """
        return await asyncio.to_thread(self._read, self._document(number))

    async def check(self, number: int, text: str) -> SettingsCheck:
        """Return what the run's settings would be like with this text in place of a file; raises as `read`."""
        return await asyncio.to_thread(self._check, self._document(number), text)

    async def changed(self, number: int, text: str, path: str, value: TomlValue) -> str:
        """Return a text in place of a file with another value of a field of its form.

        Raises
        ------
        CommandError
            There is no such file or field, or the text is written so that only a person can change it.
        """
        return await asyncio.to_thread(with_setting, self._document(number).kind, text, path, value)

    async def save(self, number: int, text: str, digest: str) -> SettingsText:
        """Write a text in place of a file, whole or not at all; return it as `read` would.

        Raises
        ------
        CommandError
            The file is shipped, has been changed since, or cannot be written; or the text is wrong.
        """
        return await asyncio.to_thread(self._save, self._document(number), text, digest)

    async def keep_places(self, settings: Settings) -> None:
        """Write the places of a run into the map file that it was started with, if it was.

        Those of a shipped map go to a file in the user's state folder, which the next run with that map reads.

        Raises
        ------
        CommandError
            The file cannot be read or written.
        """
        async with self._keeping:
            await asyncio.to_thread(self._keep_places, settings)

    async def restart(self) -> None:
        """End the run and start it again with the same command.

        Raises
        ------
        CommandError
            The settings are wrong, or this run cannot be started again.
        """
        try:
            await asyncio.to_thread(self._reload)
        except UserError as error:
            raise CommandError(f"the settings are wrong, and the run goes on: {error}") from None
        if (why := self._restart()) is not None:
            raise CommandError(why)

    def _keep_places(self, settings: Settings) -> None:
        """Write the places in force to the file of the known room; those of a shipped room go to a file of their own.

        Without a known room, or where it was loaded since, nothing is written. It blocks: call it in a thread.

        Raises
        ------
        CommandError
            The file cannot be read or written, or none has the room.
        """
        document = self._map_file(settings)
        if document is None:
            return
        if document.path is None:
            text = world_text(with_places(WorldConfig(), settings.places), (HEAD.format(document.name),))
            self._put(document, kept_places(Path(document.name).stem), text)
        else:
            text, world = self._world(document)
            if world.places() != settings.places:
                self._put(document, document.path, text_with_places(text, settings.places))

    def _map_file(self, settings: Settings) -> DocumentRead | None:
        """Return the file that has the known room, or had it before it was edited.

        None if the room was loaded since the run began, or stands in the settings themselves.

        Raises
        ------
        CommandError
            A file is no world any more, or none is known to have had the room.
        """
        room = settings.perception.localization.known_room
        if room is None:
            return None
        for document in reversed(self._documents):  # the map is read after the emulator's world
            if document.kind == "worlds":
                _, world = self._world(document)
                if _room(settings, world, document.name) == room:
                    self._map = (room, document)
                    return document
        known, document_before = self._map
        if room == known and document_before is None and any(one.kind == "worlds" for one in self._documents):
            raise CommandError(
                "the places are in force, but not kept: the map's file has changed since the run began; save the map"
            )
        return document_before if room == known else None

    def _world(self, document: DocumentRead) -> tuple[str, WorldConfig]:
        """Return a world file's text, and what it says.

        Raises
        ------
        CommandError
            It cannot be read, or is no world.
        """
        text = self._read(document)["text"]
        try:
            return text, parse_text(WorldConfig, text, document.name)
        except ConfigError as error:
            raise CommandError(f"the places are in force, but not kept in {document.name}: {error}") from None

    def _document(self, number: int) -> DocumentRead:
        """Return the file with this number in the list of pages.

        Raises
        ------
        CommandError
            There is none.
        """
        if number >= len(self._documents):
            raise CommandError(f"there is no settings file {number}")
        return self._documents[number]

    def _read(self, document: DocumentRead) -> SettingsText:
        """Return a file's text, the digest of its bytes, and its form.

        Raises
        ------
        CommandError
            It cannot be read.
        """
        try:
            data = read_shipped(document) if document.path is None else read_file(document.path)
            text = data.decode("utf-8-sig")
        except (OSError, ValueError) as error:
            raise CommandError(f"{document.name}: cannot be read: {error}") from None
        return {"text": text, "digest": hashlib.sha256(data).hexdigest(), "form": form_of(document.kind, text)}

    def _check(self, document: DocumentRead, text: str) -> SettingsCheck:
        """Return what would be wrong with the settings if a file had this text, and how that differs from its own.

        A shipped file cannot be changed, and is not checked.
        """
        before = self._read(document)["text"]
        diff = difflib.unified_diff(
            before.splitlines(), text.splitlines(), document.name, f"{document.name}, changed", lineterm=""
        )
        problems: list[ProblemRow] = []
        warnings: list[str] = []
        if document.path is not None:
            try:
                with in_place_of(document.path, text.encode("utf-8", "surrogatepass")):
                    warnings = list(lint_settings(self._reload()))
            except ConfigError as error:
                found = [located(line, document.name, text) for line in error.problems]
                problems = [{"line": line, "text": said} for line, said in found]
            except UserError as error:
                problems = [{"line": None, "text": str(error)}]
        form = form_of(document.kind, text)
        return {"problems": problems, "warnings": warnings, "difference": "\n".join(diff), "form": form}

    def _save(self, document: DocumentRead, text: str, digest: str) -> SettingsText:
        """Write a file and return it as it is then.

        Raises
        ------
        CommandError
            It is a shipped one, no longer has the bytes of `digest`, or would be wrong.
        """
        if document.path is None:
            raise CommandError(f"{document.name} comes with the program: download a copy, and name it in the command")
        before = self._read(document)
        if before["digest"] != digest:
            raise CommandError(
                f"{document.name} has changed since it was opened, by another program or by a place on the map: "
                "download a copy of the text, then open the file again"
            )
        if problems := self._check(document, text)["problems"]:
            raise CommandError(f"{document.name} is not saved: {problems[0]['text']}")
        if "\r\n" in before["text"]:  # a page has plain line ends
            text = text.replace("\r\n", "\n").replace("\n", "\r\n")
        with contextlib.suppress(CommandError):
            self._map_file(self._settings)  # once its walls are others, it is not recognised
        self._put(document, document.path, text)
        return self._read(document)

    def _put(self, document: DocumentRead, path: Path, text: str) -> None:
        """Write a file in place of what is there.

        Raises
        ------
        CommandError
            It cannot be written.
        """
        try:
            _write(path.resolve(), text)
        except OSError as error:
            raise CommandError(f"{document.name}: cannot be written: {error.strerror or error}") from None


def _room(settings: Settings, world: WorldConfig, name: str) -> WorldConfig | None:
    """Return the known room of a run with this world as its map; None if it has no surface."""
    try:
        return with_room(settings, world, name).perception.localization.known_room
    except ConfigError:
        return None


def _write(path: Path, text: str) -> None:
    """Write a file with this text; one that is there is replaced, and its permissions stay."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as part:
        part.write_text(text, encoding="utf-8", newline="")
        if path.exists():
            part.chmod(path.stat().st_mode & 0o7777)
