"""Sends commands to a run from another program."""

from __future__ import annotations

import os
import socket
import struct
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from kybflow.command_server import protocol
from kybflow.command_server.address import find_run, peer_of, user_name
from kybflow.command_server.protocol import LineBuffer, MessageUnreadable
from kybflow.core.errors import KybflowError
from kybflow.runtime.commanding.orders import Answer

TIMEOUT = 60.0
"""The time to wait for an answer, s. A run answers within two ticks once its devices are open."""
_LONGEST_REPLY = 1 << 24
_AT_ONCE = 1 << 16
_TIMEVAL = struct.Struct("ll")


class CommandRefused(KybflowError):
    """The run refused a command; the message says why."""


class RunUnreachable(KybflowError):
    """The run doesn't answer; the message says why."""


class RunClient:
    """A connection to a run, used as a context manager. Each command returns the run's Answer; it
    raises CommandRefused if the run refuses the command, and RunUnreachable if the run no longer
    answers.

    name: the client's name in the run's record and for other clients. keeps_lease: whether the
    client keeps the lease when the connection closes.
    """

    def __init__(self, address: Path, name: str, *, keeps_lease: bool = False) -> None:
        self._address = address
        self._channel = _connected(address)
        self._lines = LineBuffer(_LONGEST_REPLY)
        self._last_id = 0
        try:
            own = protocol.introduction(self._next_id(), name, keeps_lease=keeps_lease)
            _accepted(self._asked(own))
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> RunClient:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the connection; this frees the lease unless `keeps_lease` is set."""
        self._channel.close()

    def command(self, words: str, *, take: bool = False) -> Answer:
        """Send a command as on the command line, such as `switch mk hold`."""
        return _accepted(self._asked(protocol.command(self._next_id(), words, take=take)))

    def emit(self, event: str, *, take: bool = False) -> Answer:
        """Emit an event that the mission waits for."""
        return self.command(f"emit {event}", take=take)

    def switch(self, vehicle: str, state: str, *, take: bool = False, **values: object) -> Answer:
        """Let a vehicle enter a state. values: parameters of the state, such as `position=[1, 0,
        1]` or `speed="50 cm/s"`."""
        written = (f" {name}={_written(value)}" for name, value in values.items())
        return self.command(f"switch {vehicle} {state}{''.join(written)}", take=take)

    def set(self, option: str, value: object, *, take: bool = False) -> Answer:
        """Set a parameter of a part: `set("mk.processors.limit_speed.speed", "1 m/s")`."""
        return self.command(f"set {option} {value}", take=take)

    def enable(self, processor: str, *, take: bool = False) -> Answer:
        """Switch a processor on, such as `mk.processors.limit_speed`."""
        return self.command(f"enable {processor}", take=take)

    def disable(self, processor: str, *, take: bool = False) -> Answer:
        """Switch a processor off."""
        return self.command(f"disable {processor}", take=take)

    def phase(self, flow: str, phase: str, *, take: bool = False) -> Answer:
        """Let a flow enter a phase."""
        return self.command(f"phase {flow} {phase}", take=take)

    def track(
        self,
        vehicle: str,
        time: float,
        position: Sequence[float],
        *,
        velocity: Sequence[float] | None = None,
        acceleration: Sequence[float] | None = None,
        heading: float | None = None,
        take: bool = False,
    ) -> Answer:
        """Send a point of a trajectory to a vehicle in `trajectory_input`. time: seconds of the
        run. position, velocity, acceleration: x, y, z in the world frame, in
        metres and seconds. heading: rad. What is left out, the vehicle fits to the points around
        it; the heading stays. Raises CommandRefused for a point that can't be flown."""
        vectors = {"position": position, "velocity": velocity, "acceleration": acceleration}
        words = [
            f"{name}=[{', '.join(repr(float(number)) for number in vector)}]"
            for name, vector in vectors.items()
            if vector is not None
        ]
        if heading is not None:
            words.append(f"heading={float(heading)!r}")
        return self.command(f"track {vehicle} time={float(time)!r} {' '.join(words)}", take=take)

    def pause(self, *vehicles: str) -> Answer:
        """Hold the given vehicles, or all if none is given."""
        return self.command(" ".join(("pause", *vehicles)))

    def resume(self, *vehicles: str, take: bool = False) -> Answer:
        """Let the given vehicles continue, or all if none is given."""
        return self.command(" ".join(("resume", *vehicles)), take=take)

    def reset(self, *vehicles: str, take: bool = False) -> Answer:
        """Take the given vehicles out of `fault`, or all if none is given. They must be on the
        ground."""
        return self.command(" ".join(("reset", *vehicles)), take=take)

    def land(self, *vehicles: str) -> Answer:
        """Land the given vehicles for the rest of the run, or all if none is given."""
        return self.command(" ".join(("land", *vehicles)))

    def stop(self, reason: str = "") -> Answer:
        """Land all vehicles and end the run."""
        return self.command(f"stop {reason}")

    def release(self) -> Answer:
        """Give up the lease."""
        return self.command("release")

    def state(self) -> dict[str, Any]:
        """Return the run's state and legal commands: the JSON that `kybflow command state`
        prints."""
        reply = self._asked(protocol.question(self._next_id(), "state"))
        _accepted(reply)
        state: dict[str, Any] = reply["state"]
        return state

    def watch(self) -> Iterator[dict[str, Any]]:
        """Yield each event from now until the end of the run, as in `events.jsonl`. If events come
        too fast, an event `missed` with their `count` replaces them. The events use a separate
        connection, so that this one can send commands at the same time."""
        watcher = RunClient(self._address, "watcher")
        _accepted(watcher._asked(protocol.question(watcher._next_id(), "watch")))
        return watcher._watched()

    def _watched(self) -> Iterator[dict[str, Any]]:
        with self:
            self._channel.settimeout(None)
            while (reply := self._read()) is not None:
                if "event" in reply:
                    yield reply["event"]
                elif "missed" in reply:
                    yield {"event": "missed", "fields": {"count": reply["missed"]}}

    def _next_id(self) -> int:
        self._last_id += 1
        return self._last_id

    def _asked(self, line: bytes) -> dict[str, Any]:
        """Send a request and return its answer."""
        try:
            self._channel.sendall(line)
        except TimeoutError:
            raise RunUnreachable(f"the run has read nothing for {TIMEOUT:g} s") from None
        except OSError:
            pass  # the run's last message may say why it hung up
        while (reply := self._read()) is not None:
            if reply.get("id") in (self._last_id, None):
                return reply
        raise RunUnreachable("the run is over")

    def _read(self) -> dict[str, Any] | None:
        """Return the next message of the run, or None if the run has hung up."""
        while True:
            try:
                if (line := self._lines.next()) is not None:
                    return protocol.read_message(line)
            except MessageUnreadable as error:
                raise RunUnreachable(f"the run sends an unreadable message: {error}") from None
            try:
                data = self._channel.recv(_AT_ONCE)
            except TimeoutError:
                raise RunUnreachable(f"the run doesn't answer within {TIMEOUT:g} s") from None
            except OSError:
                data = b""
            if not data:
                return None
            self._lines.feed(data)


def connect(run: str | Path | None = None, name: str | None = None) -> RunClient:
    """Connect to a run. run: its folder, the folder's name, or the beginning of the name before a
    `-` (the mission's name); None for the only run. name: the client's name. Raises RunNotFound or
    RunUnreachable."""
    program = os.path.basename(sys.argv[0]) or "python"
    own = printable(f"{user_name(os.geteuid())}, {program}, process {os.getpid()}")
    address = find_run(None if run is None else os.fspath(run))
    return RunClient(address, own if name is None else name)


def commander_here() -> str:
    """Return a client name made of the user and the terminal or session, so that all commands from
    one shell share a lease."""
    try:
        place = f"at {os.ttyname(0).removeprefix('/dev/')}"
    except OSError:
        place = f"in session {os.getsid(0)}"
    return printable(f"{user_name(os.geteuid())} {place}")


def printable(name: str) -> str:
    """Return a text as a valid client name: shortened, with `?` for each unprintable letter."""
    shown = "".join(letter if letter.isprintable() else "?" for letter in name)
    return shown[: protocol.LONGEST_NAME]


def _connected(address: Path) -> socket.socket:
    channel = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    # with Python's timeout, connect() fails at once where others connect at the same time
    channel.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, _TIMEVAL.pack(int(TIMEOUT), 0))
    try:
        channel.connect(os.fspath(address))
        channel.settimeout(TIMEOUT)
        if peer_of(channel).uid != os.geteuid():
            raise RunUnreachable(f"`{address}` is another user's")
    except OSError as error:
        channel.close()
        raise RunUnreachable(f"no run answers at `{address}`: {error.strerror or error}") from None
    except RunUnreachable:
        channel.close()
        raise
    return channel


def _written(value: object) -> str:
    """Format a value as in a mission."""
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_written, value))}]"
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    return str(value)


def _accepted(reply: dict[str, Any]) -> Answer:
    if not reply.get("accepted"):
        raise CommandRefused(str(reply.get("reason", "")))
    return Answer(True, str(reply.get("reason", "")))
