"""Motion JPEG over HTTP: images with the time stamps of their server."""

import threading
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, HTTPServer

import pytest

from tacdata.wire.image_stream import ImageStream

STAMPED = [b"Content-Type: image/jpeg\r\nContent-Length: 4\r\nX-Timestamp: 1700000000.25\r\n\r\nabcd\r\n"]
BARE = [b"Content-Length: 3\r\n\r\nxyz\r\n", b"Content-Length: 2\r\n\r\nuv\r\n"]


@contextmanager
def served(parts, kind="multipart/x-mixed-replace; boundary=frame"):
    class Handler(BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200)
            self.send_header("Content-Type", kind)
            self.end_headers()
            self.wfile.write(b"".join(b"--frame\r\n" + part for part in parts))

        def log_message(self, format, *args):
            pass

    server = HTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, args=(0.01,))
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}/"
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


def test_images_come_with_the_servers_time():
    with served(STAMPED) as url:
        stream = ImageStream(url, 5.0)
        part = stream.read()
        assert stream.stamped and part.data == b"abcd" and part.device_ns == 1_700_000_000_250_000_000
        assert stream.read() is None
        stream.close()


def test_images_without_a_stamp_have_none():
    with served(BARE) as url:
        stream = ImageStream(url, 5.0)
        assert [stream.read().data for _ in BARE] == [b"xyz", b"uv"] and not stream.stamped
        stream.close()


@pytest.mark.parametrize(
    ("parts", "kind"),
    [
        (STAMPED, "text/html"),
        ([], "multipart/x-mixed-replace; boundary=frame"),
        ([b"Content-Type: image/jpeg\r\n\r\nabcd"], "multipart/x-mixed-replace; boundary=frame"),
        ([b"Content-Length: 99\r\n\r\ncut off"], "multipart/x-mixed-replace; boundary=frame"),
    ],
    ids=["a page", "nothing", "no length", "cut off"],
)
def test_what_is_no_motion_jpeg_is_refused(parts, kind):
    with served(parts, kind) as url, pytest.raises(OSError, match="no motion JPEG"):
        ImageStream(url, 5.0)
