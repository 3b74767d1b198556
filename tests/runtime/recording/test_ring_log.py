"""A ring log reads back to the bit; every problem of a file is reported in one line."""

from __future__ import annotations

import bz2
import gzip
import lzma
import math
import os
import tracemalloc
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given
from hypothesis import strategies as st

from drivers.messages import CrossPaths, Firing, Pose
from runtime.recording.ring_log import LINE_MAX_BYTES, RingLogError, read_ring_log
from runtime.recording.ring_log_rows import write_ring_log
from tests.examples import examples

HEADER = "t,x,y,theta,r00,r01\n"


def firing(t: float, ranges: list[float], pose: Pose | None = None, yaw: float = 0.0) -> Firing:
    return Firing(t, pose or Pose(0.0, 0.0, 0.0), yaw, np.array(ranges, dtype=np.float64))


def same(a: Iterable[Firing], b: Iterable[Firing]) -> None:
    for one, other in zip(a, b, strict=True):
        left = (one.robot_s, one.pose, one.ring_yaw, one.ranges_m.tobytes())
        assert repr(left) == repr((other.robot_s, other.pose, other.ring_yaw, other.ranges_m.tobytes()))


def log(tmp_path: Path, content: str | bytes) -> Path:
    path = tmp_path / "log.csv"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def error_message(path: Path, sensors: int | None = None) -> str:
    with pytest.raises(RingLogError) as caught:
        list(read_ring_log(path, sensors))
    text = str(caught.value)
    assert len(text.splitlines()) == 1
    assert text.isprintable()
    assert text.startswith(f"{path}: ")
    assert ";" in text, "an error ends with what to do"
    assert len(text) < len(str(path)) + 300
    return text.removeprefix(f"{path}: ")


def test_reads_the_documented_format(tmp_path: Path) -> None:
    rows = "0.5,1,2,0.25,1.5,\n0.5,1e0,+2,-0.25,inf,0\n"
    first, second = read_ring_log(log(tmp_path, HEADER + rows))
    assert (first.robot_s, first.pose, first.ring_yaw) == (0.5, Pose(1.0, 2.0, 0.25), 0.25)
    assert first.ranges_m.dtype == np.float64
    np.testing.assert_array_equal(first.ranges_m, [1.5, math.nan])
    assert second.ring_yaw == -0.25
    np.testing.assert_array_equal(second.ranges_m, [math.inf, 0.0])


def test_ring_yaw_is_an_angle_of_its_own(tmp_path: Path) -> None:
    (got,) = read_ring_log(log(tmp_path, "t,x,y,theta,ring_yaw,r00\n0,0,0,1,2,3\n"))
    assert (got.pose.theta, got.ring_yaw, got.ranges_m.tolist()) == (1.0, 2.0, [3.0])


@pytest.mark.parametrize(
    "content",
    [
        b"\xef\xbb\xbf" + HEADER.encode() + b"1,0,0,0,2,3\n",
        HEADER.replace("\n", "\r\n").encode() + b"1,0,0,0,2,3\r\n",
        b"\n" + HEADER.encode() + b"\n1,0,0,0,2,3\n\n\n",
        HEADER.encode() + b"1,0,0,0,2,3",
        b'"t", x,y ,theta,"r00",r01\n"1",0, 0,0 ,2,3\n',
    ],
    ids=["byte order mark", "crlf", "blank lines", "no last newline", "quotes and spaces"],
)
def test_accepts_the_variants_that_editors_write(tmp_path: Path, content: bytes) -> None:
    (got,) = read_ring_log(log(tmp_path, content), sensors=2)
    assert (got.robot_s, got.ranges_m.tolist()) == (1.0, [2.0, 3.0])


@pytest.mark.parametrize("cell", ["inf", "Inf", "INF", "+inf", " inf", "Infinity"])
def test_spellings_of_infinity(tmp_path: Path, cell: str) -> None:
    (got,) = read_ring_log(log(tmp_path, f"{HEADER}0,0,0,0,{cell},1\n"))
    assert got.ranges_m[0] == math.inf


@pytest.mark.parametrize(
    "cell", ["nan", "NaN", "-0.5", "-inf", "1e999", "1_000", "abc", " ", "1,5", "١", "0x10", "--1"]
)
def test_bad_range_names_row_column_value_and_what_is_allowed(tmp_path: Path, cell: str) -> None:
    text = error_message(log(tmp_path, f'{HEADER}0,0,0,0,1,1\n0,0,0,0,1,"{cell}"\n'))
    assert text.startswith(f"row 3 column 'r01' is {cell!a}; allowed is metres ≥ 0, 'inf'")


@pytest.mark.parametrize("column", range(4))
@pytest.mark.parametrize("cell", ["", "inf", "-inf", "nan", "1e999", "x", "1_0"])
def test_bad_stamp_names_row_column_value_and_what_is_allowed(tmp_path: Path, column: int, cell: str) -> None:
    cells = ["0", "0", "0", "0", "1", "-1"]
    cells[column] = cell
    text = error_message(log(tmp_path, HEADER + "\r\n" + ",".join(cells) + "\n"))
    found = f"is {cell!r}" if cell else "is empty"
    assert text.startswith(f"row 3 column '{['t', 'x', 'y', 'theta'][column]}' {found}; allowed is a finite number")


@pytest.mark.parametrize(
    ("column", "cell", "action"),
    [
        (0, "2025-11-28T18:20:00.03+00:00", "write the time in seconds"),
        (0, "18:20:00.03", "write the time in seconds"),
        (1, "1,5", "write decimals with a point"),
        (4, "1,5", "write decimals with a point"),
        (4, "None", "write one of these in its place"),
        (4, "#N/A", "write one of these in its place"),
        (4, "--", "write one of these in its place"),
        (4, " ", "write one of these in its place"),
        (4, "far", "correct or delete the row"),
    ],
)
def test_a_bad_cell_is_refused_with_what_to_write(tmp_path: Path, column: int, cell: str, action: str) -> None:
    cells = ["0", "0", "0", "0", "1", "1"]
    cells[column] = f'"{cell}"'
    assert f"; {action}" in error_message(log(tmp_path, HEADER + ",".join(cells) + "\n"))


def test_an_empty_ring_yaw_is_refused(tmp_path: Path) -> None:
    text = error_message(log(tmp_path, "t,x,y,theta,ring_yaw,r00\n0,0,0,1,,3\n"))
    assert text.startswith("row 2 column 'ring_yaw' is empty")


@pytest.mark.parametrize(
    ("header", "expected"),
    [
        ("t,x,theta,r00", "row 1 lacks the column 'y'"),
        ("t;x;y;theta;r00", "row 1 separates its columns by semicolons; separate them by commas, and write decimals"),
        ("t\tx\ty\ttheta\tr00", "row 1 separates its columns by tabs"),
        ("# t x y theta r00", "row 1 separates its columns by spaces"),
        ("# recorded today", "row 1 lacks the column 't'"),
        ("0.0,1.0,2.0,3.0,4.0", "row 1 holds numbers where the header belongs; write it above them"),
        ("0.0,0.0,0.0,0.0,,4.0", "row 1 holds numbers where the header belongs"),
        ("r00,r01,t,x,y,theta", "row 1 has 'r00' as column 1 where 't' belongs"),
        ("t,x,y,theta", "row 1 has no sensor column"),
        ("t,x,y,theta,ring_yaw", "row 1 has no sensor column"),
        ("t,x,y,theta,r00,r00", "row 1 names the column 'r00' 2 times"),
        ("t,t,x,y,theta,r00", "row 1 names the column 't' 2 times"),
        ("t,x,y,theta,r01", "row 1 has 'r01' as column 5 where 'r00' belongs"),
        ("t,x,y,theta,r00,r02", "row 1 has 'r02' as column 6 where 'r01' belongs"),
        ("t,x,y,theta,r0,r1", "row 1 has 'r0' as column 5 where 'r00' belongs"),
        ("t,x,y,theta,r00,", "row 1 has '' as column 6 where 'r01' belongs"),
        ("t,x,y,theta,r00,ring_yaw", "row 1 has 'r00' as column 5 where 'ring_yaw' belongs"),
        ("x,t,y,theta,r00", "row 1 has 'x' as column 1 where 't' belongs"),
    ],
)
def test_bad_header(tmp_path: Path, header: str, expected: str) -> None:
    text = error_message(log(tmp_path, f"{header}\n0,0,0,0,0,0\n"))
    assert text.startswith(expected)
    assert "t,x,y,theta[,ring_yaw],r00,r01" in text


@pytest.mark.parametrize("row", ["0,0,0,0,1", "0,0,0,0,1,1,1", "0", "0;0;0;0;1;1"])
def test_row_of_another_length(tmp_path: Path, row: str) -> None:
    text = error_message(log(tmp_path, f"{HEADER}0,0,0,0,1,1\n{row}\n"))
    assert text.startswith(f"row 3 has {row.count(',') + 1} cells where the header has 6; ")


def test_time_runs_backwards(tmp_path: Path) -> None:
    text = error_message(log(tmp_path, f"{HEADER}1.5,0,0,0,1,1\n1.5,0,0,0,1,1\n\n1.25,0,0,0,1,1\n"))
    assert text.startswith("row 5 column 't' is 1.25, earlier than 1.5 before it; t never decreases")


@pytest.mark.promise("P14")
def test_a_quote_too_few_does_not_swallow_the_rest_of_the_file(tmp_path: Path) -> None:
    """In CSV a quoted cell may span lines; as one row, a gigabyte of them would all be held in memory."""
    path = log(tmp_path, f'{HEADER}0,0,0,0,1,"1\n"\n' + '","\n' * 200_000)
    tracemalloc.start()
    try:
        assert error_message(path).startswith("row 2 is not CSV (unexpected end of data)")
        assert tracemalloc.get_traced_memory()[1] < 2_000_000
    finally:
        tracemalloc.stop()


def test_sensor_count_differs(tmp_path: Path) -> None:
    path = log(tmp_path, f"{HEADER}0,0,0,0,1,1\n")
    assert len(list(read_ring_log(path, sensors=2))) == 1
    text = error_message(path, sensors=24)
    assert "2 sensor columns (r00 to r01)" in text
    assert "24 sensors" in text


@pytest.mark.parametrize("content", [b"", b"\xef\xbb\xbf", b"\n\r\n"])
def test_empty_file(tmp_path: Path, content: bytes) -> None:
    assert error_message(log(tmp_path, content)).startswith("is empty; ")


def test_header_alone(tmp_path: Path) -> None:
    assert error_message(log(tmp_path, HEADER + "\n")).startswith("holds no firing")


def test_not_utf8_names_the_row_and_byte(tmp_path: Path) -> None:
    text = error_message(log(tmp_path, HEADER.encode() + b"0,0,0,0,1,1\n0,0,\xff\n"))
    assert text.startswith("row 3 is not UTF-8 (0xff at byte 5); ")


@pytest.mark.parametrize(
    ("content", "what"),
    [
        (HEADER.encode() + b"0,0,0,0,1,1\n\0\0\0", "holds NUL bytes"),
        (HEADER.encode("utf-16-le"), "holds NUL bytes"),
        (b"\x7fELF\0\0\n", "holds NUL bytes"),
        (gzip.compress(b"t,x\n"), "row 1 is compressed (gzip); unpack the file first"),
        (bz2.compress(b"t,x\n"), "row 1 is compressed (bzip2); unpack the file first"),
        (lzma.compress(b"t,x\n"), "row 1 is compressed (xz); unpack the file first"),
        (b"PKt,x\n", "row 1 is compressed (zip, or a spreadsheet as xlsx); unpack the file first"),
    ],
    ids=["nuls at the end", "utf-16", "binary", "gzip", "bzip2", "xz", "zip"],
)
def test_what_is_no_text_is_named(tmp_path: Path, content: bytes, what: str) -> None:
    assert what in error_message(log(tmp_path, content))


@pytest.mark.parametrize(
    "content",
    [
        HEADER + '0,0,0,0,1,"1\n' + "1\n" * 10,
        HEADER + '0,0,0,0,1,"1' + ("1" * 1000 + "\n") * 200,
        HEADER + '0,0,0,0,1,"1"x\n',
        (HEADER + "0,0,0,0,1,1\n").replace("\n", "\r"),
    ],
    ids=["quote never closed", "field over the limit", "text after a quote", "carriage returns alone"],
)
def test_not_csv(tmp_path: Path, content: str) -> None:
    text = error_message(log(tmp_path, content))
    assert "is not CSV" in text
    assert text.startswith("row 1 " if content.count("\n") == 0 else "row 2 ")


def test_endless_line_is_not_read_to_its_end(tmp_path: Path) -> None:
    path = log(tmp_path, HEADER)
    with path.open("ab") as file:
        file.truncate(1 << 40)  # a sparse terabyte of zeros, which would never fit
    assert "row 2 is longer than" in error_message(path)


def test_long_cell_is_shown_short(tmp_path: Path) -> None:
    text = error_message(log(tmp_path, f"{HEADER}0,0,0,0,1,{chr(228) * 5000}\n"))
    assert text.startswith("row 2 column 'r01' is '\\xe4")


def test_absent_file_and_folder(tmp_path: Path) -> None:
    assert error_message(tmp_path / "none.csv").startswith("cannot be read: No such file or directory; check")
    assert error_message(tmp_path).startswith("cannot be read: Is a directory; check")


def test_an_error_comes_only_after_the_good_rows(tmp_path: Path) -> None:
    firings = read_ring_log(log(tmp_path, f"{HEADER}0,0,0,0,1,1\nbad\n"))
    assert next(firings).robot_s == 0.0
    with pytest.raises(RingLogError, match="row 3"):
        next(firings)


finite = st.floats(allow_nan=False, allow_infinity=False)
ranges = st.one_of(st.floats(min_value=0.0), st.just(math.nan), st.just(math.inf))


@st.composite
def recordings(draw: st.DrawFn) -> list[Firing]:
    sensors = draw(st.integers(1, 120))
    times = sorted(draw(st.lists(finite, min_size=1, max_size=8)))
    return [
        Firing(
            t,
            Pose(draw(finite), draw(finite), draw(finite)),
            draw(finite),
            np.array([draw(ranges) for _ in range(min(sensors, 6))] * 20, dtype=np.float64)[:sensors],
        )
        for t in times
    ]


@examples(0.3, HealthCheck.function_scoped_fixture)
@given(recordings())
def test_round_trip_to_the_bit(tmp_path: Path, firings: list[Firing]) -> None:
    path = tmp_path / "log.csv"
    write_ring_log(path, iter(firings))
    nan = np.float64(math.nan)
    canonical = [
        Firing(f.robot_s, f.pose, f.ring_yaw, np.where(np.isnan(f.ranges_m), nan, f.ranges_m)) for f in firings
    ]
    same(read_ring_log(path, len(firings[0].ranges_m)), canonical)


@examples(0.5, HealthCheck.function_scoped_fixture)
@given(st.data())
def test_a_damaged_file_is_read_or_refused_and_nothing_else(tmp_path: Path, data: st.DataObject) -> None:
    content = bytearray(f"{HEADER}0,0,0,0,1,inf\n1,0.5,0,0,,1\n".encode())
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(content)))
        content[at : at + data.draw(st.integers(0, 3))] = data.draw(st.binary(max_size=3))
    path = log(tmp_path, bytes(content))
    try:
        for got in read_ring_log(path):
            assert math.isfinite(got.robot_s)
            assert not (got.ranges_m < 0.0).any()
    except RingLogError:
        error_message(path)


@pytest.mark.parametrize(
    ("firings", "expected"),
    [
        ([], "no firing to write"),
        ([firing(0.0, [])], "row 2 would have 0 sensors"),
        ([firing(0.0, [1.0, 2.0]), firing(0.0, [1.0])], "row 3 would have 1 sensors"),
        ([firing(1.0, [1.0]), firing(0.5, [1.0])], "row 3 .* t ≥ 1.0"),
        ([firing(math.nan, [1.0])], "row 2 would have t"),
        ([firing(0.0, [1.0], Pose(0.0, math.inf, 0.0))], "row 2 would have t"),
        ([firing(0.0, [1.0], yaw=math.nan)], "row 2 would have t"),
        ([firing(0.0, [-1.0])], "row 2 would have the range -1.0"),
    ],
)
def test_refuses_to_write_what_it_could_not_read(tmp_path: Path, firings: list[Firing], expected: str) -> None:
    with pytest.raises(RingLogError, match=expected):
        write_ring_log(tmp_path / "log.csv", firings)


def test_cannot_be_written(tmp_path: Path) -> None:
    with pytest.raises(RingLogError, match="cannot be written: No such file or directory; check"):
        write_ring_log(tmp_path / "none" / "log.csv", [firing(0.0, [1.0])])


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full, the device that is always full")
def test_disk_full() -> None:
    with pytest.raises(RingLogError, match="/dev/full: cannot be written: No space left on device"):
        write_ring_log(Path(os.devnull).with_name("full"), [firing(float(t), [1.0] * 24) for t in range(1000)])


def test_line_limit_leaves_room_for_the_largest_ring(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    write_ring_log(path, [firing(0.0, [1.2345678901234567e-300] * 255)])
    assert max(map(len, path.read_bytes().splitlines())) * 5 < LINE_MAX_BYTES
    assert len(next(read_ring_log(path, sensors=255)).ranges_m) == 255


# Cross paths.

CROSS = "t,x,y,theta,ring_yaw,r00,r01,r02,x01_00,x00_02\n"


def heard(*paths: tuple[int, int, float]) -> CrossPaths:
    transmitters, listeners, half_paths_m = zip(*paths, strict=True)
    return CrossPaths(np.array(transmitters), np.array(listeners), np.array(half_paths_m))


def test_cross_paths_come_back_exactly(tmp_path: Path) -> None:
    path, ranges = tmp_path / "log.csv", [math.nan] * 3
    written = [
        replace(firing(0.0, ranges), cross_paths=heard((1, 0, 1.1), (0, 2, math.inf))),
        firing(1.0, ranges),
        replace(firing(2.0, ranges), cross_paths=heard((0, 2, 0.1 + 0.2))),
    ]
    write_ring_log(path, written, [(1, 0), (0, 2)])
    lines = path.read_text("utf-8").splitlines()
    assert lines[0] == CROSS.strip()
    assert lines[2].endswith(",,,,,")
    first, second, third = (f.cross_paths for f in read_ring_log(path, sensors=3))
    assert second is None
    for found, put in ((first, written[0].cross_paths), (third, written[2].cross_paths)):
        assert found is not None
        assert put is not None
        for one, other in zip(
            (found.transmitters, found.listeners, found.half_paths_m),
            (put.transmitters, put.listeners, put.half_paths_m),
            strict=True,
        ):
            np.testing.assert_array_equal(one, other)
            assert one.dtype == other.dtype


def test_cross_paths_without_a_column_are_refused(tmp_path: Path) -> None:
    firings = [replace(firing(0.0, [1.0, 2.0]), cross_paths=heard((0, 1, 1.0)))]
    with pytest.raises(RingLogError, match="row 2 would have a cross path without a column; name the pairs"):
        write_ring_log(tmp_path / "log.csv", firings)


@pytest.mark.parametrize("column", ["x00_00", "x00_03", "x0_1", "x000_001", "x00_01_", "xyz"])
def test_columns_of_cross_paths_name_two_sensors(tmp_path: Path, column: str) -> None:
    with pytest.raises(RingLogError, match=f"row 1 has the column '{column}'; half paths come last"):
        list(read_ring_log(log(tmp_path, f"t,x,y,theta,r00,r01,r02,{column}\n0,0,0,0,1,1,1,1\n")))


def test_a_bad_half_path_is_named(tmp_path: Path) -> None:
    with pytest.raises(RingLogError, match="row 2 column 'x00_02' is '-1'"):
        list(read_ring_log(log(tmp_path, f"{CROSS}0,0,0,0,0,1,1,1,1,-1\n")))
