"""Checks every request: a token or the loopback, and a limit on sizes."""

from __future__ import annotations

import hmac
import json
import re
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any

Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
Application = Callable[[Message, Receive, Send], Awaitable[None]]

SMALL, LARGE = 64 * 1024, 64 * 1024 * 1024
"""Most bytes of a request's body; the large one for results of workers and pieces of recordings."""
ROOMY = ("/api/work/results/", "/api/recordings")
OPEN_PATHS = ("/", "/docs", "/openapi.json", "/favicon.ico")
"""Content that needs no token: it does not come from the store."""
LOOPBACK = re.compile(r"(localhost|127\.\d+\.\d+\.\d+|\[::1\])(:\d+)?", re.IGNORECASE)


class Guard:
    """An ASGI layer. Without a token only requests addressed to the loopback pass, so that no web page of elsewhere
    reaches the service through the user's own browser."""

    def __init__(self, app: Application, token: str = "") -> None:
        """Stand before an application; an empty token means loopback alone."""
        self._app, self._token = app, token

    async def __call__(self, scope: Message, receive: Receive, send: Send) -> None:
        """Let a request pass, or answer 401, 403 or 413 in words."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        headers = {name.decode("latin-1").lower(): value.decode("latin-1") for name, value in scope["headers"]}
        if answer := self._refusal(scope, headers):
            await _answer(send, *answer)
            return
        limit = LARGE if scope["path"].startswith(ROOMY) else SMALL
        length = headers.get("content-length", "0")
        if not length.isdigit() or int(length) > limit:
            await _answer(send, 413, f"a request of {length} bytes", f"at most {limit} bytes", "send less")
            return
        body = await _body(receive, limit)
        if body is None:
            await _answer(send, 413, "a request without end", f"at most {limit} bytes", "send less")
            return
        await self._app(scope, _once(body, receive), send)

    def _refusal(self, scope: Message, headers: dict[str, str]) -> tuple[int, str, str, str] | None:
        if self._token:
            token = headers.get("authorization", "").removeprefix("Bearer ").strip()
            # In constant time: its duration must not show how much of a guessed token is right.
            if scope["path"] in OPEN_PATHS or hmac.compare_digest(token.encode(), self._token.encode()):
                return None
            what = "a wrong token" if token else "no token"
            return 401, what, "the token that `tacdata farm up` was started with", "give it with --token"
        if not LOOPBACK.fullmatch(headers.get("host", "")):
            return (
                403,
                f"a request to host {headers.get('host', '')[:100]!r}",
                "localhost, as no token is set",
                ("start `tacdata farm up` with --token to be reached under other names"),
            )
        # Browsers name the page that asks: a stranger's page must not command a service without a token.
        origin = headers.get("origin", "")
        if origin and not LOOPBACK.fullmatch(origin.partition("://")[2]):
            return 403, f"a request from the page {origin[:100]!r}", "this service's own page", "open the page itself"
        return None


async def _body(receive: Receive, limit: int) -> bytes | None:
    parts, size = [], 0
    while True:
        message = await receive()
        # The application learns of it when it asks for more.
        if message["type"] == "http.disconnect":
            return b"".join(parts)
        parts.append(message.get("body", b""))
        size += len(parts[-1])
        if size > limit:
            return None
        if not message.get("more_body"):
            return b"".join(parts)


def _once(body: bytes, receive: Receive) -> Receive:
    """Return a receiver that gives the body that was read, and then the rest of the stream."""
    given = False

    async def again() -> Message:
        nonlocal given
        if given:
            return await receive()
        given = True
        return {"type": "http.request", "body": body, "more_body": False}

    return again


async def _answer(send: Send, status: int, fault: str, allowed: str, remedy: str) -> None:
    text = json.dumps({"given": fault, "allowed": allowed, "next": remedy}).encode()
    headers = [(b"content-type", b"application/json"), (b"content-length", str(len(text)).encode())]
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": text})
