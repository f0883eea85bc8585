"""One client of the command server: what it has sent, what it is to be sent, and who it is."""

from __future__ import annotations

import pwd
import socket

from kybflow.command_server.address import PeerProcess
from kybflow.command_server.protocol import (
    LONGEST_LINE,
    LineBuffer,
    OrderRequest,
    Request,
    read_request,
)

MOST_UNANSWERED = 8
"""How many requests of one client may wait for their answers; it is not heard meanwhile."""
MOST_UNREAD = 1 << 20
"""Bytes that a client may leave unread before it is let go."""
_PATIENCE = 1 << 16
"""Bytes that a client may leave unread and still be heard."""
_AT_ONCE = 1 << 14


class ConnectedClient:
    """channel: connected, never waits. since: when it was accepted, s. is_guest: it came when there
    was no room, and only what makes the flight safer is heard of it."""

    def __init__(self, channel: socket.socket, peer: PeerProcess, since: float) -> None:
        self.since = since
        self.name = f"{user_name(peer.uid)}, process {peer.pid}"
        self.is_guest = self.was_refused = False
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
        """Whether something that was received can be heard now."""
        return (self._has_lines or self.held is not None) and self._may_speak

    @property
    def wants_input(self) -> bool:
        return not (self._ended or self._has_lines) and self.held is None and self._may_speak

    @property
    def wants_output(self) -> bool:
        return bool(self._out)

    @property
    def _may_speak(self) -> bool:
        return self.unanswered < MOST_UNANSWERED and len(self._out) < _PATIENCE

    @property
    def is_done(self) -> bool:
        """Whether it has hung up and nothing of it is left to do."""
        left = self._has_lines or self.held is not None or self.unanswered or self._out
        return self.is_gone or (self._ended and not left)

    @property
    def was_cut(self) -> bool:
        """Whether it hung up in the middle of a message."""
        return self._lines.has_more

    @property
    def is_slow(self) -> bool:
        return len(self._out) > MOST_UNREAD

    def receive(self) -> None:
        """Take in what has arrived."""
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
        """Return the next request; None while there is none. Raises MessageUnreadable."""
        if self.held is not None:
            request, self.held = self.held, None
            return request
        line = self._lines.next()
        if line is None:
            self._has_lines = False
            return None
        return read_request(line)

    def send(self, line: bytes) -> None:
        """Send a line, now or when the client reads again."""
        self._out += line
        self.flush()

    def flush(self) -> None:
        """Send what waits, as far as the client reads."""
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


def user_name(uid: int) -> str:
    """Return a user's name, or `user NUMBER` for one without a name."""
    try:
        return pwd.getpwuid(uid).pw_name
    except KeyError:
        return f"user {uid}"
