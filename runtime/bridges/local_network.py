"""Runs on the local network: a run announces itself by multicast DNS (RFC 6762, 6763), and finds the others.

Run as a program, it serves one run, as a process of its own: a line of JSON on standard input for each change of the
run's name or mode, a line on standard output with all other runs whenever they change. It ends with its input. What
is announced is no secret, and what is found is not trusted: a page's address, with no token, and bounded texts.
"""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
import logging
import socket
import sys
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import orjson

from runtime import VERSION

if TYPE_CHECKING:
    from zeroconf import ServiceStateChange, Zeroconf
    from zeroconf.asyncio import AsyncServiceInfo, AsyncZeroconf

SERVICE: Final = "_echolocate._tcp.local."
LOOPBACK: Final = "127.0.0.1"
LIFETIME_S: Final = 60
"""After this time without a word a run is forgotten; one that ends says so."""
QUIET_S: Final = 0.3
"""Least time from one line on standard output to the next."""
LOOK_UP_MS: Final = 3000.0
ROBOTS_MAX: Final = 64
TEXT_MAX: Final = 64


class Announced(NamedTuple):
    """A run on the network."""

    name: str
    mode: str
    address: str
    port: int
    version: str

    @property
    def url(self) -> str:
        """Address of its page; a browser needs that run's own token."""
        return f"http://{self.address}:{self.port}/"


class Finder:
    """Collects the runs that are announced.

    The service named `own` is not listed.
    """

    def __init__(self, network: AsyncZeroconf, own: str = "") -> None:
        from zeroconf.asyncio import AsyncServiceBrowser

        self.robots: dict[str, Announced] = {}
        """The runs found, by the names of their services."""
        self.changed = asyncio.Event()
        """Set after every change."""
        self._network, self._own = network, own
        self._tasks: set[asyncio.Task[None]] = set()
        """Look-ups under way."""
        self._browser = AsyncServiceBrowser(network.zeroconf, SERVICE, handlers=[self._on_change])

    async def close(self) -> None:
        """Look no further."""
        await self._browser.async_cancel()
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    def _on_change(self, zeroconf: Zeroconf, service_type: str, name: str, state_change: ServiceStateChange) -> None:
        """Look up a service that is new or changed; drop one that has gone. zeroconf calls it in the loop."""
        from zeroconf import ServiceStateChange

        del zeroconf, service_type
        if name == self._own:
            return
        if state_change is ServiceStateChange.Removed:
            if self.robots.pop(name, None) is not None:
                self.changed.set()
        elif len(self._tasks) < ROBOTS_MAX:
            task = asyncio.get_running_loop().create_task(self._look_up(name), name=f"look up {name}")
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)

    async def _look_up(self, name: str) -> None:
        """Ask for what a service says of itself, and list the run if it can be reached."""
        from zeroconf.asyncio import AsyncServiceInfo

        info = AsyncServiceInfo(SERVICE, name)
        if not await info.async_request(self._network.zeroconf, LOOK_UP_MS):
            return
        found = announced(info.properties, info.parsed_addresses(), info.port)
        if found is not None and (name in self.robots or len(self.robots) < ROBOTS_MAX):
            self.robots[name] = found
            self.changed.set()


def announced(
    properties: Mapping[bytes, bytes | None], addresses: Iterable[str], port: int | None
) -> Announced | None:
    """Return the run that a service describes, with bounded texts; None if it has no usable address.

    Anyone on the network may have written its properties.
    """
    usable = [str(address) for text in addresses if (address := _usable_address(text)) is not None]
    if port is None or not 0 < port < 65536 or not usable:
        return None
    name, mode, version = (_text(properties.get(key)) for key in (b"name", b"mode", b"version"))
    return Announced(name or "a robot without a name", mode or "?", usable[0], port, version)


def _usable_address(text: str) -> ipaddress.IPv4Address | None:
    with contextlib.suppress(ValueError):
        return ipaddress.IPv4Address(text)
    return None


def _text(value: bytes | None) -> str:
    words = (value or b"").decode("utf-8", "replace")
    return "".join(letter for letter in words if letter.isprintable())[:TEXT_MAX]


async def find_robots(seconds: float, interfaces: Sequence[str] | None = None) -> list[Announced]:
    """Return the runs that answer on the local network, by name.

    They are asked for on interfaces with these addresses, by default on all.

    Raises
    ------
    OSError
        There is no network to ask on.
    """
    from zeroconf import InterfaceChoice, IPVersion
    from zeroconf.asyncio import AsyncZeroconf

    network = AsyncZeroconf(
        interfaces=InterfaceChoice.All if interfaces is None else list(interfaces), ip_version=IPVersion.V4Only
    )
    try:
        finder = Finder(network)
        await asyncio.sleep(seconds)
        await finder.close()
    finally:
        await network.async_close()
    return sorted(finder.robots.values())


def addresses_of(host: str) -> list[str]:
    """Return the addresses at which a console that listens on this one can be reached; all of this machine's for any.

    The host is an IPv4 address, or that of all interfaces.
    """
    import ifaddr

    if host not in {"0.0.0.0", "::"}:  # noqa: S104 - compared, not bound to
        return [host]
    found = [str(ip.ip) for adapter in ifaddr.get_adapters() for ip in adapter.ips if ip.is_IPv4]
    return [address for address in found if not ipaddress.ip_address(address).is_loopback]


async def serve(host: str, port: int, lines: asyncio.StreamReader) -> None:
    """Announce a run and report the others, until the lines end.

    The run is announced, and others are looked for, only on the host's address. Each line is a JSON object with the
    run's name and mode.

    Raises
    ------
    OSError
        There is no network to announce on.
    """
    from zeroconf import IPVersion
    from zeroconf.asyncio import AsyncZeroconf

    first = await lines.readline()
    if not first:
        return
    addresses = addresses_of(host)
    if not addresses:
        raise OSError("this machine has no address that others reach")
    network = AsyncZeroconf(interfaces=addresses, ip_version=IPVersion.V4Only)
    try:
        info = _service(addresses, port, orjson.loads(first))
        await network.async_register_service(info, allow_name_change=True)
        finder = Finder(network, info.name)
        reporting = asyncio.create_task(_report(finder), name="report")
        while line := await lines.readline():
            await network.async_update_service(_service(addresses, port, orjson.loads(line), info.name))
        reporting.cancel()
        await asyncio.gather(reporting, return_exceptions=True)
        await finder.close()
        await network.async_unregister_all_services()
    finally:
        await network.async_close()


def _service(addresses: Sequence[str], port: int, about: Mapping[str, Any], name: str = "") -> AsyncServiceInfo:
    """Return a service; `name` is that under which it is registered already."""
    from zeroconf.asyncio import AsyncServiceInfo

    host = socket.gethostname().partition(".")[0][:TEXT_MAX]
    return AsyncServiceInfo(
        SERVICE,
        name or f"{host}-{port}.{SERVICE}",
        port=port,
        server=f"{host}.local.",
        parsed_addresses=list(addresses),
        host_ttl=LIFETIME_S,
        other_ttl=LIFETIME_S,
        properties={
            "name": _text(str(about["name"]).encode()),
            "mode": _text(str(about["mode"]).encode()),
            "version": VERSION,
        },
    )


async def _report(finder: Finder) -> None:
    """Write all runs that are known whenever they have changed."""
    while True:
        await finder.changed.wait()
        finder.changed.clear()
        rows = [{**one._asdict(), "url": one.url} for one in sorted(finder.robots.values())]
        sys.stdout.buffer.write(orjson.dumps(rows) + b"\n")
        sys.stdout.buffer.flush()
        await asyncio.sleep(QUIET_S)


async def main(host: str, port: int) -> None:
    """Serve the run whose console listens here; see the module."""
    logging.getLogger("zeroconf").addHandler(logging.NullHandler())
    lines = asyncio.StreamReader()
    await asyncio.get_running_loop().connect_read_pipe(lambda: asyncio.StreamReaderProtocol(lines), sys.stdin)
    try:
        await serve(host, port, lines)
    except OSError as error:
        sys.stderr.write(f"other robots cannot be found: {error}\n")


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1], int(sys.argv[2])))
