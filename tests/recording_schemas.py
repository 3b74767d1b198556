"""JSON schemas of a recording's messages, made from their models: `python -m tests.recording_schemas` writes them."""

from __future__ import annotations

from runtime.recording.channels import CHANNELS, SCHEMAS, made_schema


def file() -> bytes:
    """Return what the file holds: a line for each payload type."""
    kinds = {kind.__name__: kind for kind in CHANNELS.values()}
    lines = [f'"{name}": '.encode() + made_schema(kind) for name, kind in kinds.items()]
    return b"{\n" + b",\n".join(lines) + b"\n}\n"


if __name__ == "__main__":
    SCHEMAS.write_bytes(file())
