"""The settings files of a run on the page: read, checked, saved, and the run started again."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.files import documents_read, noting_files_read
from config.load import load_settings, load_world, with_known_room, with_room
from config.places import PlaceConfig, PlacesConfig
from config.settings import Settings
from runtime.cli.commands.run.run_settings import SettingsFiles as RunFiles
from runtime.console.commands.command_error import CommandError
from runtime.console.files.settings_files import SettingsFiles

ROBOT = Path(__file__).parents[4] / "config" / "robots" / "denning.toml"


class Run:
    """A run started in a folder with files of its own."""

    def __init__(self, folder: Path) -> None:
        self.robot = folder / "mine.toml"
        self.robot.write_bytes(ROBOT.read_bytes())
        self.config = folder / "run.toml"
        self.config.write_text('robot = "./mine.toml"\nworld = "hallway"\n')
        self.restarts = 0
        self.refusal: str | None = None
        with noting_files_read():
            settings = self.load()
            self.files = SettingsFiles(documents_read(), settings, self.load, self._restart)

    def load(self) -> Settings:
        return load_settings(self.config)

    def _restart(self) -> str | None:
        self.restarts += self.refusal is None
        return self.refusal

    def number(self, name: str) -> int:
        return next(n for n, row in enumerate(self.files.listed()) if row["name"].endswith(name))


@pytest.fixture
def run(tmp_path: Path) -> Run:
    return Run(tmp_path)


async def test_the_files_are_those_of_the_run(run: Run) -> None:
    assert [(row["kind"], Path(row["name"]).name, row["shipped"]) for row in run.files.listed()] == [
        ("run", "run.toml", False), ("robot", "mine.toml", False), ("world", "hallway.toml", True),
        ("model", "semicircle.toml", True),
    ]  # fmt: skip
    for number in range(4):
        assert (await run.files.read(number))["text"]
    with pytest.raises(CommandError):
        await run.files.read(4)


async def test_a_change_is_checked_with_the_whole_run_and_saved(run: Run) -> None:
    number = run.number("mine.toml")
    held = await run.files.read(number)
    wrong = held["text"].replace("count = 24", "count = 0")
    found = await run.files.check(number, wrong)
    assert [problem["line"] for problem in found["problems"]] == [wrong.splitlines().index("count = 0") + 1]
    assert "-count = 24\n+count = 0" in found["difference"]
    assert run.robot.read_text() == held["text"], "a check writes nothing"
    with pytest.raises(CommandError, match="not saved"):
        await run.files.save(number, wrong, held["digest"])
    good = held["text"].replace("speed_max_m_s = 0.5", "speed_max_m_s = 0.4")
    assert (await run.files.check(number, good))["problems"] == []
    run.robot.chmod(0o640)
    saved = await run.files.save(number, good, held["digest"])
    assert saved["text"] == run.robot.read_text() == good
    assert run.robot.stat().st_mode & 0o777 == 0o640
    assert run.load().body.speed_max_m_s == 0.4
    assert sorted(path.name for path in run.robot.parent.iterdir()) == ["mine.toml", "run.toml"]
    with pytest.raises(CommandError, match="another program"):
        await run.files.save(number, held["text"], held["digest"])


async def test_a_shipped_file_is_not_changed_and_a_link_stays_one(run: Run) -> None:
    with pytest.raises(CommandError, match="comes with the program"):
        await run.files.save(run.number("hallway.toml"), "", "0" * 64)
    real = run.robot.with_name("real.toml")
    run.robot.rename(real)
    run.robot.symlink_to(real)
    number = run.number("mine.toml")
    held = await run.files.read(number)
    await run.files.save(number, "# mine\n" + held["text"], held["digest"])
    assert run.robot.is_symlink()
    assert real.read_text().startswith("# mine\n")


async def test_line_ends_of_another_system_are_kept(run: Run) -> None:
    run.robot.write_bytes(run.robot.read_bytes().replace(b"\n", b"\r\n"))
    number = run.number("mine.toml")
    held = await run.files.read(number)
    await run.files.save(number, "# mine\u2028still mine\n" + held["text"].replace("\r\n", "\n"), held["digest"])
    assert run.robot.read_bytes().count(b"\r\n") == run.robot.read_bytes().count(b"\n") > 20
    assert run.robot.read_text().startswith("# mine\u2028still mine\n"), "no line end, though it ends a line of text"


async def test_a_run_is_started_again_only_with_settings_that_are_right(run: Run) -> None:
    await run.files.restart()
    assert run.restarts == 1
    run.refusal = "not this one"
    with pytest.raises(CommandError, match="not this one"):
        await run.files.restart()
    run.config.write_text("robot = 7\n")
    with pytest.raises(CommandError, match="the run goes on"):
        await run.files.restart()
    assert run.restarts == 1


async def test_changed_places_are_kept_in_the_map_that_the_run_was_started_with(tmp_path: Path) -> None:
    path, other = tmp_path / "map.toml", tmp_path / "other.toml"
    text = (
        "# by hand\n[[wall]]\nx1_m = 0.0\ny1_m = 3.0\nx2_m = 4.0\ny2_m = 3.0\n"
        '[start]\nx_m = 1.0\n[acoustics]\nmodel = "specular"\n'
    )
    for file in (path, other):
        file.write_text(text)
    with noting_files_read():
        settings = with_known_room(load_settings("hallway", world=str(other)), str(path))
        files = SettingsFiles(documents_read(), settings, lambda: settings, lambda: None)
    charger = PlacesConfig(place=(PlaceConfig(name="charger", x_m=1.0, y_m=2.0),))
    marked = settings.model_copy(update={"places": charger})
    await files.keep_places(marked)
    assert path.read_text().startswith(text)
    assert with_known_room(settings, str(path)).places == charger
    assert other.read_text() == text, "the emulator's world is no map"
    await files.keep_places(settings)
    assert path.read_text() == text
    await files.keep_places(with_room(marked, load_world("room"), "map"))
    assert path.read_text() == text, "of another map that was loaded since"
    path.write_text("[[wall]")
    with pytest.raises(CommandError, match="not kept in"):
        await files.keep_places(marked)


@pytest.mark.parametrize("by", ["page", "editor", "editor before", "editor, without walls"])
async def test_places_are_kept_in_a_map_whose_walls_were_edited_since(tmp_path: Path, by: str) -> None:
    """A page or an editor may change the walls, which count at the next start; the places are kept beside them."""
    path = tmp_path / "map.toml"
    path.write_text("[[wall]]\nx1_m = 0.0\ny1_m = 3.0\nx2_m = 4.0\ny2_m = 3.0\n")
    with noting_files_read():
        settings = with_known_room(load_settings("hallway"), str(path))
        files = SettingsFiles(documents_read(), settings, lambda: settings, lambda: None)
    marked = settings.model_copy(update={"places": PlacesConfig(place=(PlaceConfig(name="a", x_m=1.0, y_m=2.0),))})
    number = len(files.listed()) - 1
    held = await files.read(number)
    edited = "# cleared\n" if "without" in by else held["text"].replace("4.0", "5.0")
    if by == "page":
        await files.save(number, edited, held["digest"])
    elif by != "editor before":
        await files.keep_places(marked)
        await files.keep_places(settings)
    if by != "page":
        path.write_text(edited)
    if by == "editor before":
        with pytest.raises(CommandError, match="not kept"):
            await files.keep_places(marked)
        return
    await files.keep_places(marked)
    assert path.read_text().startswith(edited)
    assert load_world(str(path)).places() == marked.places


async def test_places_in_a_room_that_stands_in_the_settings_are_in_no_map(tmp_path: Path) -> None:
    with noting_files_read():
        load_settings("hallway")
        documents = [one for one in documents_read() if one.kind != "worlds"]
    walls = tmp_path / "map.toml"
    walls.write_text("[[wall]]\nx1_m = 0.0\ny1_m = 3.0\nx2_m = 4.0\ny2_m = 3.0\n")
    settings = with_known_room(load_settings("hallway"), str(walls))
    files = SettingsFiles(documents, settings, lambda: settings, lambda: None)
    await files.keep_places(settings)


async def test_places_on_a_shipped_map_are_kept_for_the_next_run_with_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    command = RunFiles(world="room", map_file="office")
    with noting_files_read():
        settings = command.read()
        files = SettingsFiles(documents_read(), settings, lambda: settings, lambda: None)
    charger = PlacesConfig(place=(PlaceConfig(name="charger", x_m=1.0, y_m=2.0),))
    await files.keep_places(settings.model_copy(update={"places": charger}))
    assert command.read().places == charger
    assert RunFiles(map_file="office", goal="charger").read(), "a goal there is known"
    assert RunFiles(map_file="room").read().places == PlacesConfig()
    await files.keep_places(settings)
    assert command.read().places == PlacesConfig()
