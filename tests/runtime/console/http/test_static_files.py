"""The files of the page, and the headers of every response."""

from __future__ import annotations

from runtime.console.http.static_files import page_files, security_headers


def test_every_file_has_its_content_type() -> None:
    files = page_files()
    assert files["/"] is files["/page/index.html"]
    assert files["/page/main.js"].content_type.startswith("text/javascript")
    assert files["/page/style.css"].content_type.startswith("text/css")
    assert all(path == "/" or path.startswith("/page/") for path in files)
    assert all(file.body for file in files.values())


def test_the_policy_allows_nothing_from_elsewhere() -> None:
    policy = security_headers("robot:8765")["Content-Security-Policy"]
    assert "default-src 'self'" in policy
    assert "ws://robot:8765" in policy
    assert "unsafe" not in policy
