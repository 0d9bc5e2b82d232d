"""Who may talk to the viewer: pages that it served itself, asked for by an address of this machine.

A browser lets any web page open a web socket to any server, this machine's included, and a page's own host name can
be pointed at this machine after it was loaded. So a request must name this machine in ``Host``, and one that comes
from a page must come from the page that was fetched there (``Origin``). The server that viser runs has no setting for
that; its only door is the function that it starts the server with.
"""

from __future__ import annotations

import functools
import inspect
import ipaddress
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http import HTTPStatus
from typing import Any
from urllib.parse import urlsplit

from capture.errors import BonetrackError


@contextmanager
def guarded(host: str) -> Iterator[None]:
    """Web socket servers that are started inside the block refuse whom ``may_talk`` refuses.

    Raises:
        BonetrackError: no server was started by the guarded function, so nothing would be refused.
    """
    import websockets.asyncio.server as door

    plain, opened = door.serve, []

    @functools.wraps(plain)
    def serve(*args: Any, process_request: Callable[..., Any] | None = None, **options: Any) -> Any:
        opened.append(True)

        async def check(connection: Any, request: Any) -> Any:
            if not may_talk(request.headers.get_all("Host"), request.headers.get_all("Origin"), host=host):
                words = "This viewer only answers pages that it served itself, at an address of its own machine.\n"
                return connection.respond(HTTPStatus.FORBIDDEN, words)
            answer = process_request(connection, request) if process_request is not None else None
            return await answer if inspect.isawaitable(answer) else answer

        return plain(*args, process_request=check, **options)

    door.serve = serve  # type: ignore[misc, assignment]
    try:
        yield
    finally:
        door.serve = plain  # type: ignore[misc]
    if not opened:
        raise BonetrackError(
            "the viewer cannot be kept from other web pages", remedy="install the version of viser that README names"
        )


def may_talk(hosts: list[str], origins: list[str], *, host: str) -> bool:
    """Whether a request with these ``Host`` and ``Origin`` headers may be answered by a server bound to ``host``.

    >>> may_talk(["127.0.0.1:8080"], ["http://127.0.0.1:8080"], host="127.0.0.1")
    True
    >>> may_talk(["127.0.0.1:8080"], ["https://elsewhere.example"], host="127.0.0.1")
    False
    >>> may_talk(["elsewhere.example:8080"], [], host="127.0.0.1")
    False
    """
    if len(hosts) != 1 or len(origins) > 1:
        return False
    if not _is_this_machine(_name(f"//{hosts[0]}"), host):
        return False
    return not origins or urlsplit(origins[0]).netloc.lower() == hosts[0].lower()


def _name(address: str) -> str:
    try:
        return (urlsplit(address).hostname or "").lower()
    except ValueError:
        return ""


def _is_this_machine(name: str, host: str) -> bool:
    """A number cannot be pointed elsewhere; of names only this machine's own count."""
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return name in {"localhost", host.lower()} or name in _names_of_this_machine()
    return True


@functools.cache
def _names_of_this_machine() -> frozenset[str]:
    """Asked for once: the full name may come from a name server, which each request would wait for."""
    return frozenset({socket.gethostname().lower(), socket.getfqdn().lower()})
