"""A report that takes long: a page says so, and all tabs get the same report when it is done."""

from __future__ import annotations

import asyncio
from http import HTTPStatus

import pytest

from runtime.console.commands.command_error import CommandError
from runtime.console.http.report_tab import KEPT_S, ReportTab


class Maker:
    """Makes reports numbered from 1, each when it is released."""

    def __init__(self) -> None:
        self.made, self.now_s, self.problem = 0, 100.0, ""
        self.release = asyncio.Event()

    async def make(self) -> bytes:
        self.made += 1
        await self.release.wait()
        if self.problem:
            raise CommandError(self.problem)
        return b"report %d" % self.made


async def test_a_tab_shows_that_the_report_is_being_made_and_a_second_tab_gets_the_same_one() -> None:
    maker = Maker()
    tab = ReportTab(maker.make, lambda: maker.now_s, limit_s=0.0)
    status, page = await tab.answer(wait=False)
    assert (status, b"The report is being made" in page) == (HTTPStatus.ACCEPTED, True)
    maker.now_s += 12.0
    status, page = await tab.answer(wait=False)
    assert (status, b"For 12 s so far" in page) == (HTTPStatus.ACCEPTED, True)
    waiting = asyncio.create_task(tab.answer(wait=True))
    maker.release.set()
    assert await waiting == (HTTPStatus.OK, b"report 1")
    assert await tab.answer(wait=False) == (HTTPStatus.OK, b"report 1"), "the first tab asks again a second later"
    maker.now_s += KEPT_S + 0.1
    assert await tab.answer(wait=True) == (HTTPStatus.OK, b"report 2"), "the run has gone on"


async def test_a_report_that_fails_at_once_is_tried_again_at_the_next_request() -> None:
    maker = Maker()
    maker.release.set()
    maker.problem = "nothing is being recorded"
    tab = ReportTab(maker.make, lambda: maker.now_s)
    with pytest.raises(CommandError, match="nothing is being recorded"):
        await tab.answer(wait=False)
    maker.problem, maker.now_s = "", maker.now_s + 0.1
    assert await tab.answer(wait=False) == (HTTPStatus.OK, b"report 2")


async def test_the_end_of_the_run_ends_a_report_that_is_being_made() -> None:
    maker = Maker()
    tab = ReportTab(maker.make, lambda: maker.now_s, limit_s=0.0)
    await tab.answer(wait=False)
    await tab.close()
    assert asyncio.all_tasks() == {asyncio.current_task()}
