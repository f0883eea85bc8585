"""Commands a run from another program, over its socket."""

from __future__ import annotations

import os
import socket
import struct
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from kybflow.command_server import protocol
from kybflow.command_server.address import find_run, peer_of
from kybflow.command_server.connected_client import user_name
from kybflow.command_server.protocol import LineBuffer, MessageUnreadable
from kybflow.core.errors import KybflowError
from kybflow.runtime.commanding.orders import Answer

TIMEOUT = 60.0
"""Seconds to wait for an answer. A run gives it within two ticks, once its devices are open."""
_LONGEST_REPLY = 1 << 24
_AT_ONCE = 1 << 16
_TIMEVAL = struct.Struct("ll")


class CommandRefused(KybflowError):
    """The run refused a command; the message says why."""


class RunUnreachable(KybflowError):
    """The run doesn't answer; the message says why."""


class RunClient:
    """A connection to a run that flies, to be used as a context. Every command returns the Answer
    of one that was accepted, and raises CommandRefused for one that was not, RunUnreachable when
    the run doesn't answer any more.

    name: who commands, for the run's record and for others that are refused meanwhile.
    keeps_lease: they hold the lease on when the connection is closed.
    """

    def __init__(self, address: Path, name: str, *, keeps_lease: bool = False) -> None:
        self._address = address
        self._channel = _connected(address)
        self._lines = LineBuffer(_LONGEST_REPLY)
        self._last_id = 0
        try:
            said = self._asked(
                protocol.introduction(self._next_id(), name, keeps_lease=keeps_lease)
            )
            _accepted(said)
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> RunClient:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Hang up. The lease is free then."""
        self._channel.close()

    def command(self, words: str, *, take: bool = False) -> Answer:
        """Give a command as the command line spells it, such as `switch mk hold`."""
        return _accepted(self._asked(protocol.command(self._next_id(), words, take=take)))

    def emit(self, event: str, *, take: bool = False) -> Answer:
        """Give the mission an event that it waits for."""
        return self.command(f"emit {event}", take=take)

    def switch(self, vehicle: str, state: str, *, take: bool = False, **values: object) -> Answer:
        """Let a vehicle enter a state, with other values of its parameters where some are given, as
        `position=[1, 0, 1]` or `speed="50 cm/s"`."""
        written = (f" {name}={_written(value)}" for name, value in values.items())
        return self.command(f"switch {vehicle} {state}{''.join(written)}", take=take)

    def set(self, option: str, value: object, *, take: bool = False) -> Answer:
        """Change a parameter, with its unit: `set("mk.processors.limit_speed.speed", "1 m/s")`."""
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

    def pause(self, *vehicles: str) -> Answer:
        """Hold vehicles, all where none is named."""
        return self.command(" ".join(("pause", *vehicles)))

    def resume(self, *vehicles: str, take: bool = False) -> Answer:
        """Let vehicles go on, all where none is named."""
        return self.command(" ".join(("resume", *vehicles)), take=take)

    def reset(self, *vehicles: str, take: bool = False) -> Answer:
        """Take vehicles on the ground, all where none is named, out of `fault`."""
        return self.command(" ".join(("reset", *vehicles)), take=take)

    def land(self, *vehicles: str) -> Answer:
        """Land vehicles, all where none is named, for the rest of the run."""
        return self.command(" ".join(("land", *vehicles)))

    def stop(self, reason: str = "") -> Answer:
        """Land everything and end the run."""
        return self.command(f"stop {reason}")

    def release(self) -> Answer:
        """Give up the lease."""
        return self.command("release")

    def state(self) -> dict[str, Any]:
        """Return what the run does and what is legal now, as `kybflow command state --json`."""
        said = self._asked(protocol.question(self._next_id(), "state"))
        _accepted(said)
        state: dict[str, Any] = said["state"]
        return state

    def watch(self) -> Iterator[dict[str, Any]]:
        """Yield each event from now on, as `events.jsonl` holds it, until the run is over. A record
        of the event `missed` stands for those that came too fast. It has a connection of its own,
        so that commands can be given meanwhile."""
        watcher = RunClient(self._address, "watcher")
        _accepted(watcher._asked(protocol.question(watcher._next_id(), "watch")))
        return watcher._watched()

    def _watched(self) -> Iterator[dict[str, Any]]:
        with self:
            self._channel.settimeout(None)
            while (said := self._read()) is not None:
                if "event" in said:
                    yield said["event"]
                elif "missed" in said:
                    yield {"event": "missed", "fields": {"count": said["missed"]}}

    def _next_id(self) -> int:
        self._last_id += 1
        return self._last_id

    def _asked(self, line: bytes) -> dict[str, Any]:
        """Send a request and return its answer."""
        try:
            self._channel.sendall(line)
        except TimeoutError:
            raise RunUnreachable(f"the run hears nothing for {TIMEOUT:g} s") from None
        except OSError:
            pass  # it may have said why it hung up
        while (said := self._read()) is not None:
            if said.get("id") in (self._last_id, None):
                return said
        raise RunUnreachable("the run is over")

    def _read(self) -> dict[str, Any] | None:
        """Return what the run says next, None when it hangs up."""
        while (said := self._next_reply()) is None:
            try:
                data = self._channel.recv(_AT_ONCE)
            except TimeoutError:
                raise RunUnreachable(f"the run doesn't answer within {TIMEOUT:g} s") from None
            except OSError:
                data = b""
            if not data:
                return None
            self._lines.feed(data)
        return said

    def _next_reply(self) -> dict[str, Any] | None:
        """Return what the run has said, None while no more of it has arrived."""
        try:
            line = self._lines.next()
            return None if line is None else protocol.read_reply(line)
        except MessageUnreadable as error:
            raise RunUnreachable(f"what the run says can't be read: {error}") from None


def connect(run: str | Path | None = None, name: str | None = None) -> RunClient:
    """Connect to a run that flies: its folder, the folder's name, the part of that before a `-`
    (the mission's name), or None for the only one. Raises RunNotFound or RunUnreachable."""
    program = os.path.basename(sys.argv[0]) or "python"
    own = printable(f"{user_name(os.geteuid())}, {program}, process {os.getpid()}")
    address = find_run(None if run is None else os.fspath(run))
    return RunClient(address, own if name is None else name)


def commander_here() -> str:
    """Return who commands from here: the user, and the terminal or the session, so that all
    commands from one shell are of one commander."""
    try:
        place = f"at {os.ttyname(0).removeprefix('/dev/')}"
    except OSError:
        place = f"in session {os.getsid(0)}"
    return printable(f"{user_name(os.geteuid())} {place}")


def printable(name: str) -> str:
    """Return a name that a commander may have."""
    shown = "".join(letter if letter.isprintable() else "?" for letter in name)
    return shown[: protocol.LONGEST_NAME]


def _connected(address: Path) -> socket.socket:
    channel = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    # with a time-out of Python's, a socket doesn't wait for others that connect at the same time
    channel.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, _TIMEVAL.pack(int(TIMEOUT), 0))
    try:
        channel.connect(os.fspath(address))
        channel.settimeout(TIMEOUT)
        if peer_of(channel).uid != os.geteuid():
            raise RunUnreachable(f"`{address}` is another user's")
    except OSError as error:
        channel.close()
        raise RunUnreachable(f"nobody answers at `{address}`: {error.strerror or error}") from None
    except RunUnreachable:
        channel.close()
        raise
    return channel


def _written(value: object) -> str:
    """A value as a mission has it."""
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_written, value))}]"
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    return str(value)


def _accepted(said: dict[str, Any]) -> Answer:
    if not said.get("accepted"):
        raise CommandRefused(str(said.get("reason", "")))
    return Answer(True, str(said.get("reason", "")))
