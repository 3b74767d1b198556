"""States as Foxglove messages: written into a file by its SDK and read back with its schemas."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import foxglove
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from config.load import load_settings
from runtime.bridges.console_client import ConsoleClient
from runtime.bridges.foxglove_scene import STATE_FIELDS, SceneChannels
from runtime.console.frames.session_info import session_info
from tests.runtime.bridges.ros2.test_topics import DRUM, WALL, state

AT = 1_700_000_000_000_000_000


def written(path: Path, robot: str, *states: dict[str, Any]) -> dict[str, list[Any]]:
    """Return the messages that a run's states become, by topic."""
    context, client = foxglove.Context(), ConsoleClient(None)  # type: ignore[arg-type]
    client.polylines = [{"number": 3, "points": [[1.0, 0.0], [2.0, 1.0]], "probability": 0.9}]
    client.segments = {1: [0.0, 1.0, 2.0, 3.0, 0.0, 0.0]}
    settings = load_settings("hallway", [f"robot={robot}"])
    with foxglove.open_mcap(path, context=context):
        channels = SceneChannels(context)
        channels.take(state(), client, AT)
        channels.begin(session_info(settings, name=None, emulated=True, units="m"), AT)
        for one in states:
            channels.take(one, client, AT)
        channels.take_log({"event": "mode", "level": "warning", "fields": {"mode": "DRIVE"}}, AT)
    found: dict[str, list[Any]] = {}
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            decoder = DecoderFactory().decoder_for(channel.message_encoding, schema)
            content = json.loads(message.data) if decoder is None else decoder(message.data)
            found.setdefault(channel.topic, []).append(content)
    return found


def full_state() -> dict[str, Any]:
    one = state(objects=[DRUM, WALL], waiting=0, firing=[0, 6], phases={"decide": 3.0})
    one["ranges"][0], one["ranges"][6] = 2.0, -1.0
    return one


def test_a_state_is_on_the_topics_of_the_export(tmp_path: Path) -> None:
    found = written(tmp_path / "a.mcap", "denning", full_state())
    assert found.keys() == {"/tf", "/pose", "/ring", "/segments", "/models", "/truth", "/log", "/state"}
    assert [(t.parent_frame_id, t.child_frame_id) for t in found["/tf"][0].transforms] == [("odom", "base")]
    (scan,) = found["/ring"]
    assert len(scan.ranges) == 24
    assert scan.ranges[0] == pytest.approx(2.381)
    assert scan.ranges[6] == math.inf
    assert math.isnan(scan.ranges[1])
    drum, wall, polyline = found["/models"][0].entities[0].lines
    assert len(drum.points) == 36
    assert [(p.x, p.y) for p in wall.points] == [(0.0, 1.0), (2.0, 1.0)]
    assert [(p.x, p.y) for p in polyline.points] == [(1.0, 0.0), (2.0, 1.0)]
    assert [text.text for text in found["/models"][0].entities[0].texts] == ["7 drum 0.99"]
    assert found["/log"][0].message == "Mode DRIVE."
    assert set(found["/state"][0]) == set(STATE_FIELDS)
    assert found["/state"][0]["phases"] == {"decide": 3.0}


def test_the_map_has_a_frame_while_the_place_in_it_is_known(tmp_path: Path) -> None:
    place = {"pose": [1.0, 0.0, 0.0], "covariance": None, "frame": [0.5, 0.0, 0.0], "probability": 0.9}
    for status in ("tracking", "localizing", "lost"):
        found = written(
            tmp_path / f"{status}.mcap", "denning", full_state() | {"localized": {**place, "status": status}}
        )
        parents = [t.parent_frame_id for t in found["/tf"][0].transforms]
        assert parents == (["map", "odom"] if status == "tracking" else ["odom"])


def test_cross_paths_are_arcs_from_where_the_ring_stood(tmp_path: Path) -> None:
    heard = [{"robot_s": 1.0, "pose": [1.0, 2.0, 0.0, math.pi / 2], "paths": [[0, 1, 1.5], [0, 23, 2.0]]}]
    found = written(tmp_path / "a.mcap", "ears", full_state() | {"cross_paths": heard})
    lines = found["/cross_paths"][0].entities[0].lines
    assert [len(line.points) for line in lines] == [9, 9]
    assert all(point.y > 3.0 for line in lines for point in line.points), "sensor 0 looks along y"


def test_an_irregular_ring_is_an_arc_for_each_sensor_that_fired(tmp_path: Path) -> None:
    one = full_state()
    one["ranges"], one["age"] = one["ranges"][:16], one["age"][:16]
    found = written(tmp_path / "a.mcap", "p3dx", one)
    assert [len(scan.ranges) for scan in found["/ring"]] == [9, 9]
    assert found["/ring"][0].ranges[0] == 2.0
