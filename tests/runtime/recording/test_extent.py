"""The length of a recording, from its ends."""

from __future__ import annotations

import os
import random
from pathlib import Path

from runtime.recording.channels import LOG
from runtime.recording.extent import UNKNOWN, recording_extent
from runtime.recording.folder_index import create_listed
from runtime.recording.mcap_file import McapFile

START_NS = 1_700_000_000_000_000_000


def written(path: Path, *, finish: bool, seconds: float = 12.5) -> Path:
    """Write a recording with a message at its beginning and one at its end."""
    create_listed(path)
    file = McapFile(path, b"{}", START_NS)
    file.add(LOG, b"{}", START_NS + round(1e9 * seconds))
    if finish:
        file.finish()
    else:
        file.flush()
        file.abandon()
        os.utime(path, ns=(START_NS, START_NS + round(1e9 * seconds)))
    return path


def test_the_length_of_a_recording_is_known_from_its_ends(tmp_path: Path) -> None:
    complete = written(tmp_path / "a.mcap", finish=True)
    assert recording_extent(complete) == (12.5, 2, True)
    cut_off = written(tmp_path / "b.mcap", finish=False)
    assert recording_extent(cut_off) == (12.5, None, False)


def test_no_damage_of_a_file_raises_or_gives_an_impossible_length(tmp_path: Path) -> None:
    data = written(tmp_path / "a.mcap", finish=True).read_bytes()
    rng, path = random.Random(4), tmp_path / "damaged.mcap"
    for size in (0, 3, 8, 20, 45, len(data) // 2, len(data) - 1):
        path.write_bytes(data[:size])
        assert not recording_extent(path).is_complete
    for _ in range(300):
        damaged = bytearray(data)
        for at in rng.sample(range(len(data)), 3):
            damaged[at] = rng.randrange(256)
        damaged[-37 + rng.randrange(29)] = rng.randrange(256)
        path.write_bytes(damaged)
        found = recording_extent(path)
        assert found.duration_s is None or 0.0 <= found.duration_s <= 1e7
    assert recording_extent(tmp_path / "none.mcap") == UNKNOWN
