"""Serves an application on the loopback, to whoever knows its address."""

import secrets
import socket
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from http import HTTPStatus
from threading import Thread

import uvicorn
from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse

from tacdata.errors import TacdataError
from tacdata.viewers.rerun.shield import LOOPBACK


def guard(api: FastAPI, token: str, headers: dict[str, str]) -> None:
    """Let only requests pass whose path begins with a token, and answer errors in words.

    Args:
        api: The application, changed in place.
        token: First part of every path.
        headers: Headers of every answer.
    """

    @api.middleware("http")
    async def guarded(request: Request, answer: Callable[[Request], Awaitable[Response]]) -> Response:
        """Answer only whoever knows the address and comes under this machine's own name."""
        given = request.url.path.strip("/").split("/")[0]
        # By DNS rebinding a foreign page can reach this port under its own name. The token is compared in constant
        # time, as the time of an answer must not reveal a part of it.
        if request.url.hostname not in (LOOPBACK, "localhost") or not secrets.compare_digest(
            given.encode(), token.encode()
        ):
            return JSONResponse({"error": "no such page"}, HTTPStatus.NOT_FOUND)
        response = await answer(request)
        response.headers.update({"Cache-Control": "no-store", **headers})
        return response

    @api.exception_handler(TacdataError)
    async def in_words(_: Request, error: TacdataError) -> JSONResponse:
        return JSONResponse({"error": str(error)}, HTTPStatus.UNPROCESSABLE_ENTITY)

    @api.exception_handler(RequestValidationError)
    async def unfit(_: Request, error: RequestValidationError) -> JSONResponse:
        first = error.errors()[0]
        return JSONResponse({"error": f"{first['loc'][-1]}: {first['msg']}"}, HTTPStatus.UNPROCESSABLE_ENTITY)


@contextmanager
def page_server(application: Callable[[str], FastAPI], port: int) -> Iterator[str]:
    """Serve a page while the context lasts, on the loopback, to whoever knows its address.

    Args:
        application: Application of a token, which its paths begin with and `guard` checks.
        port: Port; 0 takes any that is free.

    Yields:
        The address to open.
    """
    token = secrets.token_urlsafe(16)
    with serving(application(token), port) as address:
        yield f"{address}/{token}/"


@contextmanager
def serving(api: FastAPI, port: int) -> Iterator[str]:
    """Answer requests on a port of the loopback while the context lasts; 0 takes any that is free.

    Yields:
        The address, without a token.
    """
    with socket.create_server((LOOPBACK, port)) as listener:  # before the address is printed: early requests wait
        # An open page keeps its connection: without a limit the server would wait for the browser to close.
        config = uvicorn.Config(api, log_config=None, lifespan="off", timeout_graceful_shutdown=1)
        server = uvicorn.Server(config)
        thread = Thread(target=server.run, kwargs={"sockets": [listener]}, daemon=True)
        thread.start()
        try:
            yield f"http://{LOOPBACK}:{listener.getsockname()[1]}"
        finally:
            server.should_exit = True
            thread.join()
