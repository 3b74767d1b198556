"""Handlers of the commands on files: recordings that are named, kept and deleted, and what is made of them."""

from __future__ import annotations

from runtime.console.commands.command import Call
from runtime.console.commands.messages import (
    CancelJob,
    DeleteRecording,
    MakeFiles,
    NoArguments,
    PinRecording,
    RenameRecording,
)
from runtime.console.protocols import FileControl
from runtime.console.sent_messages import JobMessage


async def rename_recording(call: Call, given: RenameRecording) -> str:
    """Give a recording another name; return that."""
    return await _files(call).rename(given.file, given.to)


async def pin_recording(call: Call, given: PinRecording) -> None:
    """Keep a recording when the folder is full, or no longer."""
    await _files(call).pin(given.file, pinned=given.pinned)


async def undo_file(call: Call, _: NoArguments) -> str:
    """Take back the last new name or pin; return what is as before."""
    return await _files(call).undo()


async def delete_recording(call: Call, given: DeleteRecording) -> None:
    """Delete a recording for good."""
    await _files(call).delete(given.file)


async def make_files(call: Call, given: MakeFiles) -> int:
    """Begin to make a report or a map of a recording; return the job's number."""
    return await _files(call).make(given.kind, given.file)


def list_jobs(call: Call, _: NoArguments) -> list[JobMessage]:
    """Return what is being made, and what was made of which files can be had."""
    return _files(call).jobs.listed()


def cancel_job(call: Call, given: CancelJob) -> None:
    """End what is being made."""
    _files(call).jobs.cancel(given.job)


def _files(call: Call) -> FileControl:
    return call.available(call.context.files)
