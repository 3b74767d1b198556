"""Commands of the places on the map: set and undone as a whole, read from files, saved with the map, driven to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Literal

import orjson
from pydantic import Field

from config.load import ConfigError, parse_text
from config.places import PlacesConfig, no_such_place
from config.settings import Settings
from config.world import WorldConfig
from runtime.analysis.export.geojson import places_of_geojson, world_geojson
from runtime.analysis.export.world_file import with_places, world_text
from runtime.console.commands.command import Call
from runtime.console.commands.command_error import CommandError
from runtime.console.commands.handlers import set_goal
from runtime.console.commands.messages import MESSAGE_MAX_BYTES, NoArguments, SetGoal
from runtime.console.sent_messages import PlacesMessage

NO_UNDO = "there is no change of the places to undo"
HEAD = "The map with its places, saved from the operator console (m)."
OF_ODOMETRY = "That run had no map, so the places lie in the frame of its odometry."


@dataclass(frozen=True, slots=True)
class SetPlaces:
    """Replace all places, no-go lines and areas, and speed areas."""

    places: Annotated[PlacesConfig, Field()]


@dataclass(frozen=True, slots=True)
class GoToPlace:
    """Drive to the place of this name."""

    name: Annotated[str, Field(min_length=1, max_length=40)]


@dataclass(frozen=True, slots=True)
class ReadPlaces:
    """Ask for the places of a map, given as the text of a world file or of GeoJSON."""

    text: Annotated[str, Field(max_length=MESSAGE_MAX_BYTES)]


@dataclass(frozen=True, slots=True)
class SaveMap:
    """Ask for the map with its places, as the text of a world file or of GeoJSON."""

    format: Annotated[Literal["toml", "geojson"], Field()]


async def set_places(call: Call, given: SetPlaces) -> None:
    """Put other places in force from the next cycle on, and into the map file of the run."""
    before = call.context.tuning.current.places
    if call.context.tuning.set_places(given.places):
        call.context.places_before.append(before)
        await _keep(call)


async def undo_places(call: Call, _: NoArguments) -> None:
    """Put the places in force that the last change replaced.

    Raises
    ------
    CommandError
        There is no change to undo.
    """
    if not call.context.places_before:
        raise CommandError(NO_UNDO)
    call.context.tuning.set_places(call.context.places_before.pop())
    await _keep(call)


async def _keep(call: Call) -> None:
    if call.context.settings_files is not None:
        await call.context.settings_files.keep_places(call.context.tuning.current)


def go_to_place(call: Call, to: GoToPlace) -> None:
    """Replace the drive request by a goal at a place.

    Raises
    ------
    CommandError
        There is no place of this name, or the robot cannot drive there.
    """
    settings = call.context.tuning.current
    place = settings.places.named(to.name)
    if place is None:
        raise CommandError(no_such_place(to.name, settings.places), "name")
    set_goal(call, SetGoal(place.x_m, place.y_m, place.heading_rad, settings.places_frame))


def read_places(_: Call, given: ReadPlaces) -> Annotated[dict[str, Any], PlacesConfig]:
    """Return the places of a map file, in the form that `set_places` takes.

    Raises
    ------
    CommandError
        The text is neither a world file nor GeoJSON in metres.
    """
    try:
        if given.text.lstrip()[:1] == "{":
            places = places_of_geojson(given.text, "map")
        else:
            places = parse_text(WorldConfig, given.text, "map").places()
    except ConfigError as error:
        raise CommandError(str(error), "text") from None
    return places.model_dump(mode="json")


def save_map(call: Call, asked: SaveMap) -> str:
    """Return the known room, or without one an empty world, with the places, as the text of a file."""
    settings = call.context.tuning.current
    room = settings.perception.localization.known_room
    world = with_places(WorldConfig() if room is None else room, settings.places)
    if asked.format == "geojson":
        return orjson.dumps(world_geojson(world, "map", settings.places_frame)).decode()
    return world_text(world, (HEAD,) if settings.places_frame == "map" else (HEAD, OF_ODOMETRY))


def places_message(settings: Settings) -> PlacesMessage:
    """Return the message that shows the places to clients."""
    rows = settings.places.model_dump(mode="json")
    return {
        "type": "places",
        "frame": settings.places_frame,
        "place": rows["place"],
        "no_go_line": rows["no_go_line"],
        "no_go_area": rows["no_go_area"],
        "speed_area": rows["speed_area"],
    }
