"""Malformed messages: answered, and without effect."""

from __future__ import annotations

import pytest

from tests.runtime.console.console_case import open_console

MALFORMED: list[tuple[str, str | None]] = [
    ('{"id":1,"type":"teleoperate","v":NaN,"w":0}', "v"),
    ('{"id":1,"type":"teleoperate","v":1e999,"w":0}', "v"),
    ('{"id":1,"type":"teleoperate","v":"1","w":0}', "v"),
    ('{"id":1,"type":"teleoperate","v":true,"w":0}', "v"),
    ('{"id":1,"type":"teleoperate","v":0}', "w"),
    ('{"id":1,"type":"teleoperate","v":99,"w":0}', "v"),
    ('{"id":1,"type":"goal","x":1e9,"y":0}', "x"),
    ('{"id":1,"type":"drive_request"}', "type"),
    ('{"id":1,"type":"arm","now":true}', "now"),
    ('{"id":1,"type":"ARM"}', "type"),
    ('{"id":1}', "type"),
    ('{"id":1,"type":"delete_segments","numbers":[]}', "numbers"),
    ('{"id":1,"type":"delete_segments","numbers":[1.5]}', "numbers.0"),
    ('{"id":1,"type":"set_parameter","path":"a","value":[1]}', "value"),
]


@pytest.mark.parametrize(("text", "field"), MALFORMED)
async def test_a_malformed_message_is_answered_and_does_nothing(text: str, field: str | None) -> None:
    async with open_console() as case:
        page = await case.page()
        await page.socket.send_str(text)
        answer = await page.next("answer")
        assert (answer["id"], answer["ok"], answer["field"]) == (1, False, field)
        assert len(answer["error"]) < 200
        assert " should " not in answer["error"] or answer["error"].startswith(f"{field} should ")
        assert case.run.asked == []


WITHOUT_ID = [
    "", "arm", "[]", "null", '{"id":true,"type":"arm"}', '{"id":-1,"type":"arm"}', '{"type":"arm"}', "[" * 10_000,
    '{"id":1e400,"type":"arm"}', "\x00", "🤖",
]  # fmt: skip


@pytest.mark.parametrize("text", WITHOUT_ID)
async def test_a_message_without_a_valid_id_is_answered_without_one(text: str) -> None:
    async with open_console() as case:
        page = await case.page()
        await page.socket.send_str(text)
        answer = await page.next("answer")
        assert (answer["id"], answer["ok"]) == (None, False)
        assert case.run.asked == []


NUMBERS = ["9" * 60_000, "1" + "0" * 400, "-" + "9" * 5000, "1e308", "1e400", "NaN", "-Infinity", "0." + "3" * 60_000]
DEEP = ["[" * 60_000, '{"a":' * 10_000, '{"id":1,"type":"goal","x":' + "[" * 30_000, '{"id":' + "[" * 30_000]


BEYOND = [
    *(f'{{"id":1,"type":"goal","x":{n},"y":0}}' for n in NUMBERS),
    *DEEP,
    '{"id":1,"type":"bookmark","text":"' + "x" * 60_000 + '"}',
    '{"id":1,"type":"' + "halt" * 15_000 + '"}',
]


@pytest.mark.promise("P22")
@pytest.mark.parametrize("text", BEYOND, ids=lambda text: text[:34])
async def test_numbers_depths_and_lengths_beyond_any_use(text: str) -> None:
    """Answered in a few words, and without effect."""
    async with open_console() as case:
        page = await case.page()
        await page.socket.send_str(text)
        answer = await page.next("answer")
        assert answer["ok"] is False
        assert len(str(answer)) < 1000
        assert case.run.asked == []
