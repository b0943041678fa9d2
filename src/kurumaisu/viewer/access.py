# SPDX-License-Identifier: BSD-3-Clause
"""Who may look, and who may command."""

from __future__ import annotations

import hmac
import ipaddress
import secrets
from collections import deque
from urllib.parse import urlsplit

from kurumaisu.errors import Error

_SECRET = 24  # bytes
_MOST = 100  # tokens and sessions that are good at a time; older ones end
HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}


class AccessTokens:
    """Tokens that are good once, and sessions that are good until the server ends."""

    def __init__(self) -> None:
        self._tokens: deque[str] = deque(maxlen=_MOST)
        self._sessions: deque[str] = deque(maxlen=_MOST)

    def new_token(self) -> str:
        """Return one more token."""
        token = secrets.token_urlsafe(_SECRET)
        self._tokens.append(token)
        return token

    def redeem(self, token: str) -> str:
        """Return a session for a token, which is used up. Raise Error for one that is not good."""
        known = next((one for one in self._tokens if _same(one, token)), None)
        if known is None:
            raise Error("token: is not valid, or was used already; ask for a new one")
        self._tokens.remove(known)
        session = secrets.token_urlsafe(_SECRET)
        self._sessions.append(session)
        return session

    def check(self, session: str) -> None:
        """Raise Error for a session that this server has not given."""
        if not any(_same(one, session) for one in self._sessions):
            raise Error("session: is unknown to this server, which may have been restarted: ask for a token")


def check_host(host: str | None, names: tuple[str, ...]) -> None:
    """Raise Error unless a request was meant for this server: by localhost, an address, or one of its names.

    Anything else may be a foreign page whose name was bent to our address (DNS rebinding). The port is not looked at:
    behind ssh -L it is another one.
    """
    try:
        name = urlsplit(f"//{host}").hostname if host else None
    except ValueError:  # no address between its brackets
        name = None
    if name is None or not (name == "localhost" or name in names or _is_address(name)):
        raise Error(f"Host {host!r}: is not a name of this server; see `names` in its settings")


def check_origin(origin: str | None, host: str | None) -> None:
    """Raise Error unless it is our own page that opens a connection; a browser always says whose page it is."""
    if host is None or origin != f"http://{host}":
        raise Error(f"Origin {origin!r}: only the page of http://{host} may connect")


def _same(one: str, other: str) -> bool:
    return hmac.compare_digest(one.encode(), other.encode(errors="replace"))


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
