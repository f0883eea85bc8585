"""Serves the commands of a run over a local socket.

One thread accepts clients, puts their commands into the run's command queue, and sends back the
answers that the tick gives. The tick only appends to a deque; it never waits for the thread and
never uses a socket. The thread works in bounded rounds: a client that floods the socket slows down
its own answers but not the flight.
"""

from __future__ import annotations

import json
import os
import selectors
import socket
import time
from collections import Counter, deque
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Lock, Thread

from kybflow.command_server import protocol
from kybflow.command_server.address import listen, peer_of, write_address
from kybflow.command_server.connected_client import ConnectedClient
from kybflow.command_server.protocol import (
    Introduction,
    MessageUnreadable,
    OrderRequest,
    Request,
    StateRequest,
    WatchRequest,
)
from kybflow.core.errors import described
from kybflow.core.files import CONTROL
from kybflow.core.signals import Event
from kybflow.recording.layout import event_record
from kybflow.runtime.commanding.command_queue import OVER, CommandQueue
from kybflow.runtime.commanding.orders import Answer, is_for_anyone
from kybflow.runtime.commanding.situation import Situation

MOST_CLIENTS, MOST_RESTRICTED = 64, 8
"""The most clients, and the most restricted clients in addition. A restricted client may only send
commands that make the flight safer. A landing is therefore possible however many clients connect.
"""
BACKLOG = 16
ROUND = 0.004
"""The least time between rounds of work, s."""
LINES, COMMANDS, NEWCOMERS = 16, 1, 8
"""The most messages, commands and new clients per round."""
ANSWER_PERIOD, WATCH_PERIOD, STATE_PERIOD = 0.002, 0.02, 0.05
"""Seconds between checks for answers while one is pending, between checks for events while a client
watches, and between requests for the run's situation."""
IDLE_CLIENT = 1.0
"""Seconds after which a client that has made no request, or a restricted one, can be dropped for a
new one."""
MOST_EVENTS = 2000
"""The most events that can wait to be sent to watching clients."""
REPORT_PERIOD = 10.0
"""Seconds between events that report refusals."""
CLOSE_TIME = 0.3
"""Seconds that clients have to read their last messages after the end of the run."""

UNREADABLE = "messages that can't be read"
CUT_OFF = "clients that disconnected within a message"
OTHER_USERS = "clients of another user"
TOO_MANY = f"clients beyond the {MOST_CLIENTS} that may be connected"
SLOW_READERS = "clients that didn't read their answers"


class CommandServer:
    """Serves a run. Pass its `on_event` to `fly` as a listener and its `serve` as a server.
    refused: the number of refusals by cause, worded as in the event `clients_refused`."""

    def __init__(self) -> None:
        self.refused: Counter[str] = Counter()
        self._reported: Counter[str] = Counter()
        self._report_lock = Lock()
        self._events: deque[Event] = deque()
        self._missed = 0
        self._is_watched = False

    def on_event(self, event: Event) -> None:
        """Keep an event for the clients that watch, if there are any."""
        if self._is_watched:
            if len(self._events) < MOST_EVENTS:
                self._events.append(event)
            else:
                self._missed += 1

    @contextmanager
    def serve(self, commands: CommandQueue, folder: Path) -> Iterator[Path]:
        """Serve the run in `folder` until the context ends. Raises AddressError."""
        listener, path = listen(folder.resolve().name, BACKLOG)
        try:
            write_address(folder, path)
        except OSError as error:
            commands.complain(f"`{folder / CONTROL}` can't be written: {error.strerror}")
        wake, woken = socket.socketpair()
        loop = _Loop(self, listener, woken, commands)
        commands.last_words.append(self.unreported)
        thread = Thread(target=loop.run, name="commands", daemon=True)
        thread.start()
        try:
            yield path
        finally:
            loop.is_over = True
            wake.close()
            thread.join()
            for left in (path, folder / CONTROL):
                with suppress(OSError):
                    left.unlink()

    @property
    def has_unreported(self) -> bool:
        """Whether there are refusals since the last report."""
        return self.refused != self._reported

    def unreported(self) -> str:
        """Return the refusals since the last report in words; empty if there are none."""
        with self._report_lock:
            fresh = self.refused - self._reported
            self._reported += fresh
        return ", ".join(f"{count} {what}" for what, count in fresh.items())

    def watched(self, is_watched: bool) -> None:
        """Start or stop keeping events for clients."""
        self._is_watched = is_watched

    def events(self) -> Iterator[bytes]:
        """Yield the kept events as lines and remove them."""
        for _ in range(len(self._events)):
            yield protocol.event(event_record(self._events.popleft()))
        if self._missed:
            missed, self._missed = self._missed, 0
            yield protocol.missed(missed)


class _Loop:
    """The loop of the server's thread. The tick puts its answers into `_inbox`."""

    def __init__(
        self,
        server: CommandServer,
        listener: socket.socket,
        woken: socket.socket,
        commands: CommandQueue,
    ) -> None:
        self.is_over = False
        self._server, self._listener, self._woken = server, listener, woken
        self._commands = commands
        self._selector = selectors.DefaultSelector()
        self._connections: deque[ConnectedClient] = deque()
        self._inbox: deque[tuple[ConnectedClient, bytes]] = deque()
        self._situations: deque[Situation | None] = deque()
        self._state_requests: list[tuple[ConnectedClient, int]] = []
        self._state_asked_at = 0.0
        self._awaits_state = False
        self._reported_at = -REPORT_PERIOD
        self._round_at = 0.0

    def run(self) -> None:
        """Serve until the run is over. An error is reported and ends the service, but not the
        flight."""
        try:
            self._serve()
        except Exception as error:  # the command server must not stop the flight
            self._commands.complain(described(error))

    def _serve(self) -> None:
        try:
            self._selector.register(self._listener, selectors.EVENT_READ)
            self._selector.register(self._woken, selectors.EVENT_READ)
            while not self.is_over:
                self._round(self._wait())
            self._close()
        finally:
            self._server.watched(False)
            for connection in self._connections:
                connection.close()
            self._listener.close()
            self._woken.close()
            self._selector.close()

    def _wait(self) -> set[object]:
        """Wait until the next round is due and there is something to do. Return the objects that
        are ready to read or write."""
        early = self._round_at + ROUND - time.monotonic()
        if early > 0:
            time.sleep(early)
        due = []
        if any(connection.has_lines for connection in self._connections):
            due.append(0.0)
        if self._awaits_state or any(c.unanswered for c in self._connections):
            due.append(ANSWER_PERIOD)
        if any(c.watches for c in self._connections):
            due.append(WATCH_PERIOD)
        if self._server.has_unreported:
            due.append(max(self._reported_at + REPORT_PERIOD - time.monotonic(), 0.0))
        selected = self._selector.select(min(due, default=None))
        self._round_at = time.monotonic()
        return {key.fileobj for key, _ in selected}

    def _round(self, ready: set[object]) -> None:
        self._deliver()
        if self._listener in ready:
            self._admit()
        for connection in self._connections:
            if connection in ready and connection.wants_input:
                connection.receive()
        self._read_requests()
        now = time.monotonic()
        is_due = now - self._state_asked_at >= STATE_PERIOD
        if self._state_requests and not self._awaits_state and is_due:  # once for all clients
            self._awaits_state, self._state_asked_at = True, now
            self._commands.look(self._situations.append)
        for connection in tuple(self._connections):
            connection.flush()
            self._update(connection)
        self._server.watched(any(c.watches for c in self._connections))
        now = time.monotonic()
        if self._server.has_unreported and now - self._reported_at >= REPORT_PERIOD:
            self._reported_at = now
            self._commands.warn(self._server.unreported())

    def _admit(self) -> None:
        for _ in range(NEWCOMERS):
            try:
                channel, _ = self._listener.accept()
            except BlockingIOError:
                return
            except OSError:  # no descriptor is left, or the client is gone
                self._server.refused[TOO_MANY] += 1
                return
            channel.setblocking(False)
            reason = self._objection(channel)
            if reason is None:
                connection = ConnectedClient(channel, peer_of(channel), time.monotonic())
                connection.is_restricted = self._is_full
                self._connections.append(connection)
                self._selector.register(connection, selectors.EVENT_READ)
                continue
            self._server.refused[reason] += 1
            with suppress(OSError):
                channel.send(protocol.answer(None, Answer(False, f"refused: {reason}")))
            channel.close()

    @property
    def _is_full(self) -> bool:
        return sum(not client.is_restricted for client in self._connections) >= MOST_CLIENTS

    def _objection(self, channel: socket.socket) -> str | None:
        """Return why a client may not connect, or None. If the server is full, drop the oldest
        client that has made no request, or else the oldest restricted one."""
        if peer_of(channel).uid != os.geteuid():
            return OTHER_USERS
        if not self._is_full:
            return None
        before = time.monotonic() - IDLE_CLIENT
        idle = [c for c in self._connections if not c.has_asked and c.since <= before]
        restricted = [c for c in self._connections if c.is_restricted]
        if not idle and len(restricted) < MOST_RESTRICTED:
            return None
        leaving = min(idle or restricted, key=lambda client: client.since)
        if leaving.since > before:
            return TOO_MANY
        self._server.refused[TOO_MANY] += not leaving.has_asked
        self._drop(leaving)
        return None

    def _read_requests(self) -> None:
        """Read messages from the clients in turn, within the limits of a round."""
        lines, commands = LINES, COMMANDS
        silent = 0
        while lines and silent < len(self._connections):
            connection = self._connections[0]
            self._connections.rotate(-1)
            request: Request | MessageUnreadable | None
            try:
                request = connection.next_request() if connection.has_lines else None
            except MessageUnreadable as error:
                request = error
            if isinstance(request, OrderRequest) and not commands:
                connection.held, request = request, None
            if request is None:
                silent += 1
                continue
            lines, silent = lines - 1, 0
            if isinstance(request, MessageUnreadable):
                self._server.refused[UNREADABLE] += 1
                connection.send(protocol.answer(request.id, Answer(False, str(request))))
                continue
            commands -= isinstance(request, OrderRequest)
            connection.has_asked = True
            self._answer(connection, request)

    def _answer(self, connection: ConnectedClient, request: Request) -> None:
        connection.is_restricted = connection.is_restricted and self._is_full
        is_safe = (
            is_for_anyone(request.order)
            if isinstance(request, OrderRequest)
            else isinstance(request, Introduction)
        )
        if connection.is_restricted and not is_safe:
            self._server.refused[TOO_MANY] += not connection.was_refused
            connection.was_refused = True
            connection.send(protocol.answer(request.id, Answer(False, f"refused: {TOO_MANY}")))
            return
        match request:
            case Introduction(id, name, keeps_lease):
                known = connection.is_introduced or connection.has_commanded
                reason = f"this client is called `{connection.name}` already" if known else ""
                if not known:
                    connection.name, connection.keeps_lease = name, keeps_lease
                    connection.is_introduced = True
                connection.send(protocol.answer(id, Answer(not known, reason)))
            case OrderRequest(id, order, take):
                connection.unanswered += 1
                connection.has_commanded = True

                def answered(answer: Answer) -> None:
                    self._inbox.append((connection, protocol.answer(id, answer)))

                self._commands.ask(order, connection.name, answered, take=take)
            case StateRequest(id):
                connection.unanswered += 1
                self._state_requests.append((connection, id))
            case WatchRequest(id):
                connection.watches = True
                self._server.watched(True)
                connection.send(protocol.answer(id, Answer(True)))

    def _deliver(self) -> None:
        """Send the answers from the tick to their clients, and the events to the clients that
        watch."""
        for _ in range(len(self._inbox)):
            connection, line = self._inbox.popleft()
            connection.unanswered -= 1
            connection.send(line)
        if self._situations:
            situation, self._awaits_state = self._situations.popleft(), False
            shown = None if situation is None else json.dumps(situation.record())
            requests, self._state_requests = self._state_requests, []
            for connection, number in requests:
                connection.unanswered -= 1
                over = protocol.answer(number, Answer(False, OVER))
                connection.send(over if shown is None else protocol.state(number, shown))
        for line in self._server.events():
            for connection in self._connections:
                if connection.watches:
                    connection.send(line)

    def _update(self, connection: ConnectedClient) -> None:
        """Drop a client that is gone or doesn't read; otherwise select what to wait for."""
        if connection.is_slow:
            self._server.refused[SLOW_READERS] += 1
        if connection.is_slow or connection.is_done:
            self._drop(connection)
            return
        events = selectors.EVENT_READ if connection.wants_input else 0
        events |= selectors.EVENT_WRITE if connection.wants_output else 0
        key = self._selector.get_map().get(connection)
        if key is None and events:
            self._selector.register(connection, events)
        elif key is not None and not events:
            self._selector.unregister(connection)
        elif key is not None and key.events != events:
            self._selector.modify(connection, events)

    def _drop(self, connection: ConnectedClient) -> None:
        if connection.was_cut:
            self._server.refused[CUT_OFF] += 1
        with suppress(KeyError):
            self._selector.unregister(connection)
        self._connections.remove(connection)
        connection.close()
        name = connection.name
        others = any(other.name == name for other in self._connections)
        if connection.has_commanded and not (connection.keeps_lease or others):
            self._commands.leave(name)

    def _close(self) -> None:
        """Send the last messages to the clients that still read."""
        self._deliver()
        for connection, number in self._state_requests:
            connection.send(protocol.answer(number, Answer(False, OVER)))
        until = time.monotonic() + CLOSE_TIME
        while any(c.wants_output for c in self._connections) and time.monotonic() < until:
            time.sleep(ROUND)
            for connection in self._connections:
                connection.flush()
