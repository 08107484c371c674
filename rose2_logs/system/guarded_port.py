"""A server of this machine behind a port that refuses pages of other sites.

A browser lets a page read what its own host serves. A site whose name is made to point to 127.0.0.1 while
its page is open (DNS rebinding) is such a host, but for the ``Host`` header of its requests, which names the
site.
"""

from __future__ import annotations

import asyncio
import ipaddress
import secrets
import socket
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from urllib.parse import urlsplit

LOCAL = ("localhost", "127.0.0.1", "::1")
"""Names of this machine that no other site can have."""
HEAD_MOST_BYTES = 1 << 16
"""Longest head of a request; browsers send a few kilobytes."""
HEAD_WAIT_S = 30.0
"""Longest wait for it."""
PIECE_BYTES = 1 << 16
REFUSAL = (
    b"HTTP/1.1 403 Forbidden\r\nContent-Type: text/plain; charset=utf-8\r\nContent-Length: %d\r\n"
    b"Connection: close\r\n\r\n%s"
)
REASON = b"This server answers to its own names only.\n"
HTTP2 = b"PRI * HTTP/2.0\r\n\r\n"
"""What programs, but no browser, begin an unencrypted connection with."""


def is_welcome(host: str | None, names: tuple[str, ...] = ()) -> bool:
    """Whether a ``Host`` header, with or without a port, names this machine.

    Parameters
    ----------
    host : str or None
        The header.
    names : tuple of str
        Names besides `LOCAL`. One that stands for all addresses, as 0.0.0.0, lets in all addresses, which no
        other site can have as a name, and the name of this machine.

    Examples
    --------
    >>> is_welcome("localhost:9090"), is_welcome("[::1]"), is_welcome("rebound.example:9090")
    (True, True, False)
    >>> is_welcome("192.168.0.7:51234"), is_welcome("192.168.0.7:51234", ("0.0.0.0",))
    (False, True)
    """
    try:
        name = urlsplit(f"//{host or ''}").hostname or ""
    except ValueError:
        return False
    if name in LOCAL or name in (each.lower() for each in names):
        return True
    if any(_is_all(each) for each in names):
        return _address(name) is not None or name in (socket.gethostname().lower(), socket.getfqdn().lower())
    return False


def hidden_address() -> str:
    """Return an address of this machine that nobody guesses, where it has several."""
    if sys.platform != "linux":
        return "127.0.0.1"
    return ".".join(map(str, (127, *(1 + secrets.randbelow(254) for _ in range(3)))))


@contextmanager
def guarded_port(host: str, port: int, behind: tuple[str, int]) -> Iterator[int]:
    """Pass on to a server, until the end of the block, what names it by `host` or by this machine's names.

    Parameters
    ----------
    host : str
        Address or name to listen on.
    port : int
        Port to listen on; 0 for any that is free.
    behind : (str, int)
        Address and port of the server.

    Yields
    ------
    int
        The port.

    Raises
    ------
    OSError
        If it is in use, or the address is not of this machine.
    """
    loop = asyncio.new_event_loop()
    gate = _Gate((host,), behind)
    # As with other servers, a port of one that has just ended can be taken again.
    server = loop.run_until_complete(asyncio.start_server(gate.accept, host, port, limit=HEAD_MOST_BYTES))
    thread = threading.Thread(target=loop.run_forever, daemon=True)
    thread.start()
    try:
        yield int(server.sockets[0].getsockname()[1])
    finally:
        asyncio.run_coroutine_threadsafe(_ended(server), loop).result()
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        loop.close()


async def _ended(server: asyncio.Server) -> None:
    """Close a server and its connections, those too that are just being accepted."""
    server.close()
    while tasks := asyncio.all_tasks() - {asyncio.current_task()}:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


class _Gate:
    """Decides upon the first request of each connection; a browser keeps a connection to one host."""

    def __init__(self, names: tuple[str, ...], behind: tuple[str, int]) -> None:
        self._names = names
        self._behind = behind
        self._connections: set[asyncio.Task[None]] = set()

    def accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Begin a connection, as a task of ours.

        Of a coroutine, asyncio would make the task itself, and up to Python 3.11 it logs a traceback where
        that one is cancelled.
        """
        task = asyncio.get_running_loop().create_task(self._receive(reader, writer))
        self._connections.add(task)
        task.add_done_callback(self._connections.discard)

    async def _receive(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            with suppress(OSError, asyncio.IncompleteReadError, asyncio.LimitOverrunError, TimeoutError):
                head = await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), HEAD_WAIT_S)
                if head == HTTP2 or self._names_us(head):
                    await self._pass_on(head, reader, writer)
                else:
                    writer.write(REFUSAL % (len(REASON), REASON))
                    await writer.drain()
        finally:
            writer.close()

    def _names_us(self, head: bytes) -> bool:
        lines = head.decode("latin-1").split("\r\n")[1:]
        hosts = [line.partition(":")[2].strip() for line in lines if line.lower().startswith("host:")]
        return len(hosts) == 1 and is_welcome(hosts[0], self._names)

    async def _pass_on(self, head: bytes, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        from_server, to_server = await asyncio.open_connection(*self._behind)
        try:
            to_server.write(head)
            await asyncio.gather(_copy(reader, to_server), _copy(from_server, writer))
        finally:
            to_server.close()


async def _copy(source: asyncio.StreamReader, target: asyncio.StreamWriter) -> None:
    try:
        while piece := await source.read(PIECE_BYTES):
            target.write(piece)
            await target.drain()
        target.write_eof()
    except OSError:
        target.transport.abort()


def _address(name: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    with suppress(ValueError):
        return ipaddress.ip_address(name)
    return None


def _is_all(name: str) -> bool:
    found = _address(name)
    return found is not None and found.is_unspecified
