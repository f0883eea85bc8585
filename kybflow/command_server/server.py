"""Serves the commands of a run over a local socket.

One thread accepts, reads, hands requests to the run's command queue and brings back what the tick
answers. The tick only appends to a deque: it never waits for this thread and calls no socket. This
thread works in rounds, with a bound for what it does in each, so that whoever floods the socket
gets answers more slowly and takes no time from the flight.
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
from kybflow.runtime.commanding.lease import is_for_anyone
from kybflow.runtime.commanding.orders import Answer
from kybflow.runtime.commanding.situation import Situation

MOST_CLIENTS, GUESTS = 64, 8
"""How many clients are heard, and how many more where those don't make room: of these nothing is
heard but what makes the flight safer, so that nobody's crowd keeps it from landing."""
BACKLOG = 16
ROUND = 0.004
"""Seconds from one round of work to the next."""
LINES, COMMANDS, NEWCOMERS = 16, 1, 8
"""How many messages are heard, commands given and clients accepted in a round."""
ANSWER_PERIOD, WATCH_PERIOD, LOOK_PERIOD = 0.002, 0.02, 0.05
"""Seconds between looks for answers of the tick while any is owed, for events while somebody
watches, and between two questions for the situation."""
IDLE_CLIENT = 1.0
"""Seconds after which a client that has asked nothing, and a guest, makes room for another."""
MOST_EVENTS = 2000
"""How many events wait to be sent to those who watch."""
TOLD_EVERY = 10.0
"""Seconds between two events that say what was refused."""
FAREWELL = 0.3
"""Seconds that clients have to read what is left when the run is over."""

UNREADABLE = "messages that can't be read"
CUT = "clients that hung up in the middle of a message"
STRANGERS = "clients of another user"
CROWD = f"clients beyond the {MOST_CLIENTS} that may be connected"
SLOW = "clients that didn't read what they asked for"


class CommandServer:
    """`fly` is given `hear` as a listener and `serve` as a server. refused: how often what was
    refused, in the words that the event `clients_refused` uses."""

    def __init__(self) -> None:
        self.refused: Counter[str] = Counter()
        self._told: Counter[str] = Counter()
        self._telling = Lock()
        self._events: deque[Event] = deque()
        self._missed = 0
        self._is_watched = False

    def hear(self, event: Event) -> None:
        """Keep an event for those who watch."""
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
        commands.last_words.append(self.untold)
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
    def has_untold(self) -> bool:
        """Whether something was refused since that was told last."""
        return self.refused != self._told

    def untold(self) -> str:
        """Return what was refused since the last time, in words; empty for nothing."""
        with self._telling:
            fresh = self.refused - self._told
            self._told += fresh
        return ", ".join(f"{count} {what}" for what, count in fresh.items())

    def watched(self, is_watched: bool) -> None:
        """Begin or cease to keep events."""
        self._is_watched = is_watched

    def events(self) -> Iterator[bytes]:
        """Yield what was heard since the last time, as lines."""
        for _ in range(len(self._events)):
            yield protocol.event(event_record(self._events.popleft()))
        if self._missed:
            missed, self._missed = self._missed, 0
            yield protocol.missed(missed)


class _Loop:
    """What the thread does. The tick's answers come through `_inbox`."""

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
        self._curious: list[tuple[ConnectedClient, int]] = []
        self._looked = 0.0
        self._is_looking = False
        self._told_at = -TOLD_EVERY
        self._rounded = 0.0

    def run(self) -> None:
        """Serve until the run is over. An error ends the service, never the flight, and is told
        when nobody is served any more."""
        try:
            self._serve()
        except Exception as error:  # who serves commands must not stop the flight
            self._commands.complain(described(error))

    def _serve(self) -> None:
        try:
            self._selector.register(self._listener, selectors.EVENT_READ)
            self._selector.register(self._woken, selectors.EVENT_READ)
            while not self.is_over:
                self._round(self._wait())
            self._part()
        finally:
            self._server.watched(False)
            for connection in self._connections:
                connection.close()
            self._listener.close()
            self._woken.close()
            self._selector.close()

    def _wait(self) -> set[object]:
        """Wait until there is something to do, at least until the next round; what can be read or
        written to."""
        early = self._rounded + ROUND - time.monotonic()
        if early > 0:
            time.sleep(early)
        ready: set[object] = {key.fileobj for key, _ in self._selector.select(self._timeout())}
        self._rounded = time.monotonic()
        return ready

    def _timeout(self) -> float | None:
        if any(connection.has_lines for connection in self._connections):
            return 0.0
        due = []
        if self._is_looking or any(c.unanswered for c in self._connections):
            due.append(ANSWER_PERIOD)
        if any(c.watches for c in self._connections):
            due.append(WATCH_PERIOD)
        if self._server.has_untold:
            due.append(max(self._told_at + TOLD_EVERY - time.monotonic(), 0.0))
        return min(due, default=None)

    def _round(self, ready: set[object]) -> None:
        self._deliver()
        if self._listener in ready:
            self._admit()
        for connection in self._connections:
            if connection in ready and connection.wants_input:
                connection.receive()
        self._hear()
        self._look()
        for connection in tuple(self._connections):
            connection.flush()
            self._sort_out(connection)
        self._server.watched(any(c.watches for c in self._connections))
        self._tell()

    def _admit(self) -> None:
        for _ in range(NEWCOMERS):
            try:
                channel, _ = self._listener.accept()
            except BlockingIOError:
                return
            except OSError:  # no descriptor is left, or whoever came is gone
                self._server.refused[CROWD] += 1
                return
            channel.setblocking(False)
            reason = self._objection(channel)
            if reason is None:
                connection = ConnectedClient(channel, peer_of(channel), time.monotonic())
                connection.is_guest = self._is_full
                self._connections.append(connection)
                self._selector.register(connection, selectors.EVENT_READ)
                continue
            self._server.refused[reason] += 1
            with suppress(OSError):
                channel.send(protocol.answer(None, Answer(False, f"refused: {reason}")))
            channel.close()

    @property
    def _is_full(self) -> bool:
        return sum(not client.is_guest for client in self._connections) >= MOST_CLIENTS

    def _objection(self, channel: socket.socket) -> str | None:
        """Why a client may not connect. Who has asked nothing for a while makes room, and so does
        the guest who came first."""
        if peer_of(channel).uid != os.geteuid():
            return STRANGERS
        if not self._is_full:
            return None
        before = time.monotonic() - IDLE_CLIENT
        shy = [c for c in self._connections if not c.has_asked and c.since <= before]
        guests = [c for c in self._connections if c.is_guest]
        if not shy and len(guests) < GUESTS:
            return None
        leaving = min(shy or guests, key=lambda client: client.since)
        if leaving.since > before:
            return CROWD
        self._server.refused[CROWD] += not leaving.has_asked
        self._drop(leaving)
        return None

    def _hear(self) -> None:
        """Hear the clients in turns, a message of each, as many as a round has."""
        lines, commands = LINES, COMMANDS
        silent = 0
        while lines and silent < len(self._connections):
            connection = self._connections[0]
            self._connections.rotate(-1)
            request = self._next(connection) if connection.has_lines else None
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

    @staticmethod
    def _next(connection: ConnectedClient) -> Request | MessageUnreadable | None:
        try:
            return connection.next_request()
        except MessageUnreadable as error:
            return error

    def _answer(self, connection: ConnectedClient, request: Request) -> None:
        connection.is_guest = connection.is_guest and self._is_full
        if connection.is_guest and not _is_heard_of_guests(request):
            self._server.refused[CROWD] += not connection.was_refused
            connection.was_refused = True
            connection.send(protocol.answer(request.id, Answer(False, f"refused: {CROWD}")))
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
                self._curious.append((connection, id))
            case WatchRequest(id):
                connection.watches = True
                self._server.watched(True)
                connection.send(protocol.answer(id, Answer(True)))

    def _look(self) -> None:
        """Ask the tick for the situation: once for all who are curious."""
        now = time.monotonic()
        if self._curious and not self._is_looking and now - self._looked >= LOOK_PERIOD:
            self._is_looking, self._looked = True, now
            self._commands.look(self._situations.append)

    def _deliver(self) -> None:
        """Send what the tick has answered, and the events to those who watch."""
        for _ in range(len(self._inbox)):
            connection, line = self._inbox.popleft()
            connection.unanswered -= 1
            connection.send(line)
        if self._situations:
            self._show(self._situations.popleft())
        for line in self._server.events():
            for connection in self._connections:
                if connection.watches:
                    connection.send(line)

    def _show(self, situation: Situation | None) -> None:
        self._is_looking = False
        shown = None if situation is None else json.dumps(situation.record())
        curious, self._curious = self._curious, []
        for connection, number in curious:
            connection.unanswered -= 1
            over = protocol.answer(number, Answer(False, OVER))
            connection.send(over if shown is None else protocol.state(number, shown))

    def _sort_out(self, connection: ConnectedClient) -> None:
        """Drop a client that is gone or doesn't read; else wait for what it may do next."""
        if connection.is_slow:
            self._server.refused[SLOW] += 1
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
            self._server.refused[CUT] += 1
        with suppress(KeyError):
            self._selector.unregister(connection)
        self._connections.remove(connection)
        connection.close()
        name = connection.name
        others = any(other.name == name for other in self._connections)
        if connection.has_commanded and not (connection.keeps_lease or others):
            self._commands.leave(name)

    def _tell(self) -> None:
        """Tell what was refused since the last time, once in a while."""
        now = time.monotonic()
        if self._server.has_untold and now - self._told_at >= TOLD_EVERY:
            self._told_at = now
            self._commands.warn(self._server.untold())

    def _part(self) -> None:
        """The run is over: send what is left to those who read."""
        self._deliver()
        for connection, number in self._curious:
            connection.send(protocol.answer(number, Answer(False, OVER)))
        until = time.monotonic() + FAREWELL
        while any(c.wants_output for c in self._connections) and time.monotonic() < until:
            time.sleep(ROUND)
            for connection in self._connections:
                connection.flush()


def _is_heard_of_guests(request: Request) -> bool:
    """Whether a request is heard although there is no room."""
    if isinstance(request, OrderRequest):
        return is_for_anyone(request.order)
    return isinstance(request, Introduction)
