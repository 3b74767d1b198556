"""A folder of invalid files with short names, which the tests of the commands are run in."""

from __future__ import annotations

from pathlib import Path

import pytest

HEADER = "t,x,y,theta," + ",".join(f"r{i:02d}" for i in range(24))
ROW = ",".join(["1"] * 24)


@pytest.fixture
def bad_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the working directory, which holds them."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "regular").touch()
    (tmp_path / "broken.toml").write_text("[[drum]]\nx_m = 1.0\ny_m = = 2.0\n")
    (tmp_path / "drum.toml").write_text("[[drum]]\nx_m = 1.0\ny_m = 'two'\nradius_m = 0.3\n")
    (tmp_path / "empty.toml").write_text("")
    (tmp_path / "fault.toml").write_text("[[fault]]\nat_s = 1.0\nkind = 'earthquake'\n")
    (tmp_path / "fault_broken.toml").write_text("[[fault]\n")
    (tmp_path / "latin.toml").write_bytes(b"name = '\xe9'\n")
    (tmp_path / "good.csv").write_text(f"{HEADER}\n0,0,0,0,{ROW}\n")
    (tmp_path / "column.csv").write_text(f"{HEADER}\n".replace("y,", "") + f"0,0,0,{ROW}\n")
    rows = [f"{k},0,0,0,{ROW}" for k in range(9)]
    rows[5] = rows[5].replace(",1", ",one", 1)
    (tmp_path / "seven.csv").write_text("\n".join([HEADER, *rows]) + "\n")
    (tmp_path / "sixteen.csv").write_text(
        "t,x,y,theta," + ",".join(f"r{i:02d}" for i in range(16)) + "\n0,0,0,0," + ",".join(["1"] * 16) + "\n"
    )
    (tmp_path / "binary.csv").write_bytes(bytes(range(256)))
    return tmp_path
