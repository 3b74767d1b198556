"""Challenges: fresh for a second by the server's clock, void once the robot stops, sent to every client at once."""

from __future__ import annotations

import asyncio

from runtime.console.clients.challenges import ABSENT, KEPT, STOPPED, UNKNOWN, Challenges
from tests.runtime.console.console_case import open_console


def test_a_challenge_is_fresh_for_a_second() -> None:
    now = [5.0]
    challenges = Challenges(lambda: now[0], 1.0)
    number = challenges.newest
    for age_s, reason in (
        (0.0, None),
        (1.0, None),
        (1.25, "it arrived 1.2 s late and was not carried out: press again"),
    ):
        now[0] = 5.0 + age_s
        assert challenges.refusal_reason(number) == reason
    assert challenges.refusal_reason(None) == ABSENT
    assert challenges.refusal_reason(challenges.issue()) is None
    assert challenges.refusal_reason(number + 1) == UNKNOWN


def test_a_stop_voids_every_challenge_and_issues_a_new_one() -> None:
    challenges = Challenges(lambda: 0.0, 1.0)
    older, newer = challenges.newest, challenges.issue()
    fresh = challenges.void_all()
    assert [challenges.refusal_reason(number) for number in (older, newer, fresh)] == [STOPPED, STOPPED, None]
    assert challenges.refusal_reason(older, survives_stop=True) is None
    assert challenges.stops == 1


def test_memory_is_bounded_and_numbers_differ() -> None:
    challenges = Challenges(lambda: 0.0, 1.0)
    numbers = [challenges.issue() for _ in range(2 * KEPT)]
    assert len(set(numbers)) == len(numbers)
    assert challenges.refusal_reason(numbers[0]) == UNKNOWN
    assert challenges.refusal_reason(numbers[KEPT]) is None


async def test_every_client_gets_challenges_before_anything_is_cycled() -> None:
    async with open_console("console.watch_without_token=true") as case:
        page, watcher = await case.page(), await case.connect(token=None)
        first = await page.next("challenge")
        assert case.console.hub.challenges.refusal_reason(first["number"]) is None
        assert (await page.next("challenge"))["number"] != first["number"], "again and again"
        await page.ask(type="halt")
        case.cycles()
        await watcher.next("state")
        assert not [message for message in watcher.received if message["type"] == "challenge"], "it may only watch"


async def test_an_unsent_challenge_is_replaced_by_the_newest() -> None:
    async with open_console() as case:
        sent: list[bytes] = []
        newest: list[int] = []
        challenges = case.console.hub.challenges

        class Slow:
            async def send(self, data: bytes) -> None:
                sent.append(data)
                newest.append(challenges.newest)  # the console's timer may have issued another one by now

            def abort(self) -> None:
                raise AssertionError

        client = case.console.hub.join(Slow(), "slow", {}, has_token=True)
        for _ in range(50):
            case.console.hub.issue_challenge()
        sender = asyncio.create_task(client.send_all())
        await case.settled(lambda: len(sent) >= 2, "session information and a challenge")
        assert sent[1] == b'{"type":"challenge","number":%d}' % newest[1]
        case.console.hub.leave(client)
        client.leave()
        await sender
