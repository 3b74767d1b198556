"""A live run for Foxglove: its own websocket, in a process that is a client of the console.

Foxglove's protocol has no token, so that anyone on this machine, and any page in a browser here, can connect. So this
server shows, and changes a setting only if its start allowed it.
"""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Callable
from typing import Any, Final

import foxglove
from foxglove.websocket import Capability, Client, Parameter, ServerListener, StatusLevel, WebSocketServer

from config.errors import FAILED, UserError
from runtime.bridges.console_client import ConsoleClient, Message, stay_connected
from runtime.bridges.foxglove_scene import SceneChannels

SET_MAX_S: Final = 3.0
"""Longest wait for the run to take a setting."""
READ_ONLY: Final = "settings are shown only: start `echolocate foxglove` with --allow-set to change them here"


async def serve_foxglove(
    find: Callable[[], str], host: str, port: int, report: Callable[[str], None], *, allow_set: bool
) -> None:
    """Serve a run to Foxglove until cancelled; connect again whenever the run restarts.

    `find` returns the start URL of the run; `report` gets one line for the address and for each problem. `allow_set`:
    Foxglove may change settings.

    Raises
    ------
    UserError
        The port is in use.
    """
    bridge = _Bridge(asyncio.get_running_loop(), report, allow_set=allow_set)
    context = foxglove.Context()
    try:
        server = foxglove.start_server(
            name="echolocate",
            host=host,
            port=port,
            capabilities=[Capability.Parameters],
            server_listener=bridge,
            context=context,
        )
    except RuntimeError as error:
        raise UserError(
            f"cannot listen on {host}, port {port} ({error}); choose another with --port", FAILED
        ) from error
    bridge.server, bridge.channels = server, SceneChannels(context)
    report(f"Foxglove: open connection ws://{host}:{server.port}")
    try:
        await stay_connected(find, bridge.serve, report)
    finally:
        server.stop()


class _Bridge(ServerListener):
    """Passes what a run sends to Foxglove, and settings back."""

    server: WebSocketServer
    channels: SceneChannels

    def __init__(self, loop: asyncio.AbstractEventLoop, report: Callable[[str], None], *, allow_set: bool) -> None:
        self._loop, self._report, self._allow_set = loop, report, allow_set
        self._client: ConsoleClient | None = None
        """The connection to the run; None without one."""
        self._changes = 0
        """Changes of settings under way, for which this client keeps control."""
        self._settings: dict[str, Message] = {}
        """Settings of the run that a page can change, by path."""

    async def serve(self, client: ConsoleClient) -> None:
        """Serve one connection until it ends."""
        self._client = client
        try:
            async for message in client.messages():
                at = time.time_ns()
                match message["type"]:
                    case "state":
                        self.channels.take(message, client, at)
                    case "log":
                        self.channels.take_log(message, at)
                    case "session":
                        self.channels.begin(message, at)
                        self._keep(message["parameters"])
                    case "parameters":
                        self._keep(message["parameters"])
                # Control may come unasked, as to the first client of a run, or late, from a page that had it before.
                if message["type"] in {"session", "role"} and client.has_control and not self._changes:
                    with contextlib.suppress(UserError):  # another request has released it
                        await client.request("release_control")
        finally:
            self._client = None

    def on_get_parameters(
        self, client: Client, param_names: list[str], request_id: str | None = None
    ) -> list[Parameter]:
        """Return settings, all of them if none is named; called in a thread of the server."""
        del client, request_id
        return self._parameters(param_names)

    def on_set_parameters(
        self, client: Client, parameters: list[Parameter], request_id: str | None = None
    ) -> list[Parameter]:
        """Change settings if that is allowed; return them as they are then."""
        del client, request_id
        for parameter in parameters:
            reason = self._set(parameter) if self._allow_set else READ_ONLY
            if reason is not None:
                self.server.publish_status(f"{parameter.name}: {reason}", StatusLevel.Warning)
        return self._parameters([parameter.name for parameter in parameters])

    def _set(self, parameter: Parameter) -> str | None:
        """Change a setting and return why not, None if it is done."""
        known, value = self._settings.get(parameter.name), parameter.get_value()
        if known is None:
            return "there is no such setting"
        work = asyncio.run_coroutine_threadsafe(self._request(known, value), self._loop)
        try:
            work.result(SET_MAX_S)
        except (UserError, TimeoutError) as error:
            return str(error) or "the run does not answer"
        return None

    async def _request(self, known: Message, value: Any) -> None:  # noqa: ANN401 - a setting's value
        """Change a setting of the run, with control for as long as that takes.

        Raises
        ------
        UserError
            There is no run, or it refuses.
        """
        client = self._client
        if client is None:
            raise UserError("there is no connection to the run")
        whole = known["kind"] == "int" and isinstance(value, float)
        empty = known["optional"] and value == ""
        new = None if empty else int(value) if whole else value
        self._changes += 1
        try:
            if not client.has_control:
                await client.request("take_control")
            await client.request("set_parameter", path=known["path"], value=new)
            known["value"] = new
        finally:
            self._changes -= 1
            if client.has_control and not self._changes:
                with contextlib.suppress(UserError):
                    await client.request("release_control")

    def _keep(self, settings: list[Message]) -> None:
        """Take in the settings of the run, and show them in Foxglove."""
        self._settings = {setting["path"]: setting for setting in settings}
        self.server.publish_parameter_values(self._parameters([]))

    def _parameters(self, names: list[str]) -> list[Parameter]:
        """Return settings as parameters, all if none is named; unknown names are left out."""
        known = self._settings
        return [
            Parameter(name, value="" if known[name]["value"] is None else known[name]["value"])
            for name in (names or known)
            if name in known
        ]
