"""A client of the command server: its name, its received lines and its pending output."""

from __future__ import annotations

import socket

from kybflow.command_server.address import PeerProcess, user_name
from kybflow.command_server.protocol import (
    LONGEST_LINE,
    LineBuffer,
    OrderRequest,
    Request,
    read_request,
)

MOST_UNANSWERED = 8
"""The most pending answers of a client; the server reads nothing more from it until they are sent.
"""
MOST_UNREAD = 1 << 20
"""Bytes of unsent output above which the server drops a client."""
_MOST_PENDING = 1 << 16
"""Bytes of unsent output from which on the server stops reading from a client."""
_AT_ONCE = 1 << 14


class ConnectedClient:
    """A connected client.

    channel: a non-blocking socket. since: when it connected, s. is_restricted: whether it connected
    when the server was full, and may only send commands that make the flight safer.
    """

    def __init__(self, channel: socket.socket, peer: PeerProcess, since: float) -> None:
        self.since = since
        self.name = f"{user_name(peer.uid)}, process {peer.pid}"
        self.is_restricted = self.was_refused = False
        self.is_introduced = False
        self.keeps_lease = False
        self.has_asked = False
        self.has_commanded = False
        self.watches = False
        self.unanswered = 0
        self.is_gone = False
        self.held: OrderRequest | None = None
        self._channel = channel
        self._lines = LineBuffer(LONGEST_LINE)
        self._has_lines = False
        self._out = bytearray()
        self._ended = False

    def fileno(self) -> int:
        return self._channel.fileno()

    @property
    def has_lines(self) -> bool:
        """Whether a received line can be processed now."""
        return (self._has_lines or self.held is not None) and self._may_speak

    @property
    def wants_input(self) -> bool:
        return not (self._ended or self._has_lines) and self.held is None and self._may_speak

    @property
    def wants_output(self) -> bool:
        return bool(self._out)

    @property
    def _may_speak(self) -> bool:
        return self.unanswered < MOST_UNANSWERED and len(self._out) < _MOST_PENDING

    @property
    def is_done(self) -> bool:
        """Whether the client has hung up and nothing is pending."""
        left = self._has_lines or self.held is not None or self.unanswered or self._out
        return self.is_gone or (self._ended and not left)

    @property
    def was_cut(self) -> bool:
        """Whether the client hung up in the middle of a message."""
        return self._lines.has_more

    @property
    def is_slow(self) -> bool:
        return len(self._out) > MOST_UNREAD

    def receive(self) -> None:
        """Receive the data that has arrived."""
        try:
            data = self._channel.recv(_AT_ONCE)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        self._ended = not data
        self._lines.feed(data)
        self._has_lines = bool(data)

    def next_request(self) -> Request | None:
        """Return the next request, or None. Raises MessageUnreadable."""
        if self.held is not None:
            request, self.held = self.held, None
            return request
        line = self._lines.next()
        if line is None:
            self._has_lines = False
            return None
        return read_request(line)

    def send(self, line: bytes) -> None:
        """Queue a line and send as much as the client reads now."""
        self._out += line
        self.flush()

    def flush(self) -> None:
        """Send as much of the pending output as the client reads now."""
        try:
            while self._out:
                del self._out[: self._channel.send(self._out)]
        except BlockingIOError:
            pass
        except OSError:
            self._out.clear()
            self.is_gone = True

    def close(self) -> None:
        self.is_gone = True
        self._channel.close()
