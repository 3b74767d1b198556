"""Who may come in: the token of this run, and requests that name this server and come from its own page.

Any web page open in the operator's browser can send requests to this machine. It cannot know the token; it cannot
hide where it comes from (Origin); and a name of its own that leads here, as in DNS rebinding, shows in Host.
"""

from __future__ import annotations

import hmac
import ipaddress
import secrets
from dataclasses import dataclass, field
from typing import Final

TOKEN_BYTES: Final = 16
SCHEME: Final = "http"
HTTP_PORT: Final = 80
SHOWN_MAX: Final = 80
"""Of what a stranger sent: more does not go into the log."""


def new_token() -> str:
    """Return 128 random bits as text that can stand in an address."""
    return secrets.token_urlsafe(TOKEN_BYTES)


def is_loopback(host: str) -> bool:
    """Say whether an address or name reaches this machine only."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def in_address(host: str) -> str:
    """Return a host as it stands in an address: IPv6 in brackets."""
    return f"[{host}]" if ":" in host else host


@dataclass(frozen=True, slots=True)
class Auth:
    """Knows the token, and by which names this server is called."""

    token: str = field(repr=False)
    names: tuple[str, ...]
    """Names besides the address that a request came to: of this machine, as in the settings."""
    port: int

    def knows(self, token: str) -> bool:
        """Say whether this is the token, in a time that tells nothing about it."""
        return hmac.compare_digest(token.encode("utf-8", "surrogatepass"), self.token.encode())

    def trouble_with_host(self, host: str | None, address: str) -> str | None:
        """Say what is wrong with a Host header of a request that came to a local address; None where nothing is."""
        return None if host in self._hosts(address) else f"Host {_shown(host)} is not this console's"

    def trouble_with_origin(self, origin: str | None, host: str | None) -> str | None:
        """Say what is wrong with an Origin beside a Host that is good; None where nothing is."""
        return None if origin == f"{SCHEME}://{host}" else f"Origin {_shown(origin)} is not this console's page"

    def _hosts(self, address: str) -> tuple[str, ...]:
        names = {address, *self.names}
        if is_loopback(address):
            names.add("localhost")
        hosts = tuple(f"{in_address(name)}:{self.port}" for name in names)
        # A browser leaves out the port that goes without saying.
        return hosts if self.port != HTTP_PORT else (*hosts, *map(in_address, names))


def _shown(text: str | None) -> str:
    return "(none)" if text is None else ascii(text[:SHOWN_MAX])
