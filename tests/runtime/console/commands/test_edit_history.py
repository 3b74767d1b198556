"""The history of edits, and undo as a page asks for it."""

from __future__ import annotations

from perception.edits import ConfirmObject, DeleteSegments, Edit, LiftArea, MarkVacant, MoveObject, RestoreArea
from perception.undo import edit_with_undo
from runtime.console.commands.edit_history import KEPT, EditHistory
from tests.runtime.console.console_case import ConsoleCase, open_console

AREA = MarkVacant(4.0, 4.0, 0.5)
BACK = RestoreArea(1, 4.0, 4.0, 0.5, 0)


def test_only_the_newest_edits_are_kept() -> None:
    history = EditHistory()
    history.add(ConfirmObject(1), ())  # it changed nothing
    for k in range(KEPT + 5):
        history.add(MoveObject(k, 0.0, 0.0, 0.0), (MoveObject(k, 1.0, 0.0, 0.0),))
    newest = history.newest
    assert newest is not None
    assert newest[0] == MoveObject(KEPT + 4, 0.0, 0.0, 0.0)
    for _ in range(KEPT - 1):
        history.drop_newest()
    oldest = history.newest
    assert oldest is not None
    assert oldest[0] == MoveObject(5, 0.0, 0.0, 0.0)


def carry_out(case: ConsoleCase, *edits: Edit) -> None:
    """Run a cycle that carries these edits out."""
    done = [edit_with_undo(edit, case.run.state.perception) for edit in edits]
    case.run.state.undos = tuple(undo for _, undo in done)
    case.cycles(edits=edits, outcomes=tuple(refused for refused, _ in done))


async def test_a_page_takes_the_newest_edit_back_once() -> None:
    async with open_console() as case:
        page = await case.page()
        assert "no edit of the map" in (await page.ask(type="undo_edit"))["error"]
        case.run.state.perception.edit(AREA)
        number = await page.send(type="lift_area", area=1)
        await case.settled(lambda: case.run.asked == [LiftArea(1)], "the edit")
        assert "waits for the next cycle" in (await page.ask(type="undo_edit"))["error"]
        carry_out(case, LiftArea(1))
        assert (await page.answer(number))["ok"]
        case.run.edits_max = 0
        assert "too many edits" in (await page.ask(type="undo_edit"))["error"]
        case.run.edits_max = 8
        number = await page.send(type="undo_edit")
        await case.settled(lambda: case.run.asked == [LiftArea(1), BACK], "what takes it back")
        carry_out(case, BACK)
        assert (await page.answer(number))["data"] == "lift_area"
        assert not (await page.ask(type="undo_edit"))["ok"], "an undo is no edit to undo"


async def test_an_edit_that_was_refused_in_part_is_taken_back() -> None:
    async with open_console() as case:
        page = await case.page()
        case.cycles(40)
        numbers = case.run.state.perception.segments().numbers.tolist()
        assert numbers, "the firings made segments"
        edit = DeleteSegments((numbers[0], 999_999))
        number = await page.send(type="delete_segments", numbers=list(edit.numbers))
        await case.settled(lambda: case.run.asked == [edit], "the edit")
        carry_out(case, edit)
        assert "999999" in (await page.answer(number))["error"]
        number = await page.send(type="undo_edit")
        await case.settled(lambda: len(case.run.asked) == 2, "what takes it back")
        carry_out(case, case.run.asked[1])  # type: ignore[arg-type]  # the stub keeps whatever it is asked
        assert (await page.answer(number))["data"] == "delete_segments"
        assert numbers[0] in case.run.state.perception.segments().numbers
