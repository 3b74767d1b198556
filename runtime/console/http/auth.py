"""Authentication of requests: the token of this run, and the Host and Origin headers.

Any web page open in the operator's browser can send requests to this machine. Such a page does not know the token,
cannot forge Origin, and, with DNS rebinding, sends its own name in Host.
"""

from __future__ import annotations

import hmac
import ipaddress
import secrets
from dataclasses import dataclass, field
from typing import Final

TOKEN_BYTES: Final = 16
"""128 bits cannot be guessed over a network."""
SCHEME: Final = "http"
HTTP_PORT: Final = 80
LOGGED_MAX: Final = 80
"""Characters of a header that go into the log."""


def new_token() -> str:
    """Return a random token as text that is safe in a URL."""
    return secrets.token_urlsafe(TOKEN_BYTES)


def is_loopback(host: str) -> bool:
    """Return whether an address or host name reaches this machine only."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def url_host(host: str) -> str:
    """Return a host as it is written in a URL: IPv6 in brackets."""
    return f"[{host}]" if ":" in host else host


@dataclass(frozen=True, slots=True)
class Auth:
    """Checks requests against the token and the names of this server."""

    token: str = field(repr=False)
    names: tuple[str, ...]
    """Host names of this server besides the address to which a request came."""
    port: int

    def accepts(self, token: str) -> bool:
        """Return whether this is the token, comparing in constant time."""
        return hmac.compare_digest(token.encode("utf-8", "surrogatepass"), self.token.encode())

    def host_error(self, host: str | None, address: str) -> str | None:
        """Return why a Host header is wrong for a request that came to this local address, None if it is right."""
        return None if host in self._hosts(address) else f"Host {_quoted(host)} is not this console's"

    def origin_error(self, origin: str | None, host: str) -> str | None:
        """Return why an Origin header is wrong for a request with this valid Host, None if it is right."""
        return None if origin == f"{SCHEME}://{host}" else f"Origin {_quoted(origin)} is not this console's page"

    def _hosts(self, address: str) -> tuple[str, ...]:
        """Return the Host headers that are right for a request which came to this local address."""
        names = {address, *self.names}
        if is_loopback(address):
            names.add("localhost")
        hosts = tuple(f"{url_host(name)}:{self.port}" for name in names)
        # A browser leaves out the default port.
        return hosts if self.port != HTTP_PORT else (*hosts, *map(url_host, names))


def _quoted(text: str | None) -> str:
    return "(none)" if text is None else ascii(text[:LOGGED_MAX])
