"""Hands Rerun's web viewer to a browser under a policy by which it may talk to this machine only.

`rerun analytics disable` quiets the program. The viewer in the browser does not read that setting: it would send usage
statistics, and load fonts and examples. A content security policy forbids it whatever it tries.
"""

import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from http.client import HTTPException
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from urllib.error import HTTPError
from urllib.request import urlopen

from tacdata.viewers.rerun.steering import script

LOOPBACK = "127.0.0.1"
HERE = f"'self' http://{LOOPBACK}:* http://localhost:*"
POLICY = (
    f"default-src {HERE} data: blob:; connect-src {HERE} data: blob:; "
    f"script-src {HERE} blob: 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval'; style-src {HERE} 'unsafe-inline'; "
    "form-action 'none'"
)
"""Policy of the browser for the viewer's loads and calls; its own code needs inline scripts and WebAssembly."""
PASSED_ON = ("Content-Type", "rerun-final-length")
PATIENCE = 20.0
"""Longest wait for the viewer's own server to listen [s]."""


@contextmanager
def shielded(inner: int, port: int) -> Iterator[str]:
    """Serve a viewer's content, with the policy, while the context lasts.

    Args:
        inner: Port of Rerun's web server on the loopback.
        port: Port to offer it at; 0 takes one that is free.

    Yields:
        The address, without a slash at its end.
    """

    class Shield(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            """Pass a file on."""
            try:
                with _fetched(f"http://{LOOPBACK}:{inner}{self.path}") as answer:
                    self.send_response(answer.status)
                    for name in PASSED_ON:
                        if value := answer.headers.get(name):
                            self.send_header(name, value)
                    self.send_header("Content-Security-Policy", POLICY)
                    self.end_headers()
                    if self.path.split("?")[0] == "/":
                        self.wfile.write(answer.read().replace(b"</body>", script().encode() + b"</body>"))
                    else:
                        shutil.copyfileobj(answer, self.wfile)
            except HTTPError as error:
                self.send_error(error.code)
            except (OSError, HTTPException):
                self.close_connection = True  # the browser left, or the viewer ended

        def log_message(self, format: str, *args: object) -> None:
            """Say nothing."""

    with ThreadingHTTPServer((LOOPBACK, port), Shield) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        try:
            yield f"http://{LOOPBACK}:{server.server_address[1]}"
        finally:
            server.shutdown()


def _fetched(address: str):
    end = time.monotonic() + PATIENCE
    while True:
        try:
            return urlopen(address, timeout=PATIENCE)
        # An OSError, too, but an answer: the server listens, so there is nothing to wait for.
        except HTTPError:
            raise
        except OSError:
            if time.monotonic() > end:
                raise
            time.sleep(0.1)
