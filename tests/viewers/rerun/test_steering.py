"""The viewer's time is set by messages of Rerun's own protocol, those of Python and of the page's script alike."""

import socket
import threading

import numpy as np
import pytest

from tacdata.viewers.rerun.shield import shielded
from tacdata.viewers.rerun.steering import Moment, deepest_moment, script, steer
from tacdata.viewers.rerun.timelines import HOST
from tacdata.viewers.scenes.episode import episode_scene

pytest.importorskip("rerun.experimental")


def test_the_deepest_moment_is_the_labels(episode, label):
    moment = deepest_moment(episode_scene(episode, label))
    depth = np.maximum(label.signed, 0).reshape(len(label.time_ns), -1).max(axis=1)
    at = int(np.argmin(np.abs(label.time_ns - moment.ns)))
    assert moment.timeline == HOST and depth[at] >= 0.98 * depth.max()
    assert moment.query == f"&at=host_time%40{moment.ns}"


def test_a_window_is_asked_for_the_moment():
    """What arrives at its port names the timeline, holds the time and asks it to stand still."""
    heard, arrived = bytearray(), threading.Event()

    def listen(server):
        stream, _ = server.accept()
        with stream:
            stream.sendall(bytes([0, 0, 0, 4, 0, 0, 0, 0, 0]))  # HTTP/2: settings of its own, none
            while b"host_time" not in heard and (data := stream.recv(65_536)):
                heard.extend(data)
        arrived.set()

    moment = Moment(HOST, 1_795_674_713_839_706_056)
    with socket.create_server(("127.0.0.1", 0)) as server:
        threading.Thread(target=listen, args=(server,), daemon=True).start()
        port = server.getsockname()[1]
        threading.Thread(target=steer, args=(port, moment), daemon=True).start()
        assert arrived.wait(60)
    request = bytes(heard[heard.index(b"\x0a\x09host_time") - 2 :])
    number, time = moment.ns, bytearray()
    while number > 127:
        time.append(number & 127 | 128)
        number >>= 7
    time.append(number)
    # Field 2: the timeline's name. Field 3: the time. Field 5: paused. As steering.js writes them.
    assert request[:13] == b"\x12\x0b\x0a\x09host_time"
    assert request[13:].startswith(bytes([3 << 3 | 2, len(time) + 1, 1 << 3, *time, 5 << 3, 1]))


def test_the_page_of_the_viewer_gets_the_script():
    import http.server
    from urllib.request import urlopen

    class Inner(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200)
            self.end_headers()
            self.wfile.write(b"<html><body>viewer</body></html>" if self.path.split("?")[0] == "/" else b"</body>")

        def log_message(self, *_):
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Inner) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        with shielded(server.server_address[1], 0) as page:
            assert urlopen(f"{page}/?url=x").read().decode() == f"<html><body>viewer{script()}</body></html>"
            assert urlopen(f"{page}/re_viewer.js").read() == b"</body>"
        server.shutdown()
