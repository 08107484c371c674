"""What stands before a server lets pages of this machine in, and those of other sites out."""

from __future__ import annotations

import gc
import http.client
import socket
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from rose2_logs.system.guarded_port import HTTP2, guarded_port, hidden_address, is_welcome


class _Echo(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"

    def do_POST(self) -> None:
        body = self.rfile.read(int(self.headers["Content-Length"]))
        self.send_response(200)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_: object) -> None:
        pass


@contextmanager
def echo() -> Iterator[tuple[str, int]]:
    address = hidden_address()
    with ThreadingHTTPServer((address, 0), _Echo) as server:
        server.daemon_threads = True
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield address, server.server_port
        server.shutdown()


@pytest.mark.parametrize(
    "host", ["localhost", "LOCALHOST:80", "127.0.0.1", "127.0.0.1:9090", "[::1]", "[::1]:9090"]
)
def test_names_of_this_machine_are_welcome(host: str):
    assert is_welcome(host)


@pytest.mark.parametrize(
    "host",
    [
        None, "", "rebound.example", "rebound.example:51234", "127.0.0.1.example", "localhost.example",
        "evil@x", "10.0.0.7", "[::2]", "localhost@rebound.example", "[", "127.0.0.1:80@rebound.example",
    ],
)  # fmt: skip
def test_other_names_are_not(host: str | None):
    assert not is_welcome(host)


def test_a_name_given_by_the_user_is_welcome():
    assert is_welcome("robot.local:51234", ("Robot.local",))
    assert not is_welcome("rebound.example", ("robot.local",))
    assert is_welcome("10.0.0.7:51234", ("0.0.0.0",))
    assert is_welcome(f"{socket.gethostname()}:51234", ("::",))
    assert not is_welcome("rebound.example:51234", ("0.0.0.0",))


def test_requests_pass_and_those_of_other_sites_are_refused():
    """Bodies of some megabytes, several requests of one connection; nothing of the server is seen else."""
    body = bytes(range(256)) * 20_000
    with echo() as behind, guarded_port("127.0.0.1", 0, behind) as port:
        link = http.client.HTTPConnection("127.0.0.1", port, timeout=60)
        for _ in range(3):
            link.request("POST", "/", body)
            answer = link.getresponse()
            assert (answer.status, answer.read() == body) == (200, True)
        link.close()
        for host in ("rebound.example", f"rebound.example:{port}"):
            link = http.client.HTTPConnection("127.0.0.1", port, timeout=60)
            link.request("POST", "/", b"1", {"Host": host})
            answer = link.getresponse()
            assert (answer.status, b"own names" in answer.read()) == (403, True)
            link.close()


@pytest.mark.parametrize(
    "head",
    [
        b"GET / HTTP/1.0\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: localhost\r\nHost: rebound.example\r\n\r\n",
        b"\xff\xfe\r\n\r\n",
        b"x" * 200_000,
    ],
    ids=["no host", "two hosts", "no request", "no end"],
)
def test_what_names_no_host_gets_nothing(head: bytes):
    with echo() as behind, guarded_port("127.0.0.1", 0, behind) as port:
        with socket.create_connection(("127.0.0.1", port), timeout=60) as link:
            try:
                link.sendall(head)
                said = link.recv(100)
            except ConnectionError:
                said = b""
        assert said == b"" or said.startswith(b"HTTP/1.1 403")


def test_programs_that_speak_http_2_pass():
    """As Rerun's own viewer does, and no browser without encryption."""
    with (
        socket.create_server(("127.0.0.1", 0)) as server,
        guarded_port("127.0.0.1", 0, server.getsockname()) as port,
        socket.create_connection(("127.0.0.1", port), timeout=60) as link,
    ):
        link.sendall(HTTP2 + b"SM\r\n\r\n")
        inside, _ = server.accept()
        with inside:
            assert inside.recv(100).startswith(HTTP2)
            inside.sendall(b"settings")
        assert link.recv(100) == b"settings"


def test_connections_still_open_at_the_end_are_closed_without_a_word(caplog: pytest.LogCaptureFixture):
    """Some wait for the end of a head, some are just being accepted; asyncio logs tasks that end badly."""
    for _ in range(20):
        with ExitStack() as links, guarded_port("127.0.0.1", 0, ("127.0.0.1", 1)) as port:
            for _ in range(5):
                link = links.enter_context(socket.create_connection(("127.0.0.1", port), timeout=60))
                link.sendall(b"GET / HTTP/1.1\r\n")
        gc.collect()
    assert caplog.records == []


def test_a_port_in_use_is_an_error():
    with (
        socket.create_server(("127.0.0.1", 0)) as taken,
        pytest.raises(OSError, match="in use"),
        guarded_port("127.0.0.1", taken.getsockname()[1], ("127.0.0.1", 1)),
    ):
        pass
