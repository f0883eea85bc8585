"""What a motion-capture system says of bodies: one program and one thread a system, shared by all
who ask for its bodies. The program is begun again when it ends or falls silent."""

from __future__ import annotations

import json
import selectors
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Mapping
from typing import NamedTuple

from kybflow.core.errors import described
from kybflow.core.geometry import Quat, Vec3
from kybflow.core.signals import Time
from kybflow.sensors._waker import CHUNK, Waker

SILENT = 10.0
"""Seconds without a frame after which the program is begun again."""
FIRST_PAUSE, LONGEST_PAUSE = 1.0, 8.0
"""Seconds between one program and the next; doubled while none gives a frame."""
WAITING = 2000
"""Poses that are kept for a reader who does not come."""


class Arrived(NamedTuple):
    """A pose as the library gives it; time: when it arrived, on the monotonic clock."""

    time: Time
    position: Vec3
    attitude: Quat


class BodySubscription:
    """One body of a system. Close it."""

    def __init__(self, feed: Feed, body: str) -> None:
        self.body = body
        self.came: deque[Arrived] = deque(maxlen=WAITING)
        self._feed = feed

    def take(self) -> list[Arrived]:
        """The poses that came since the last call, oldest first."""
        came = self.came
        return [came.popleft() for _ in range(len(came))]

    def trouble(self) -> str | None:
        """Why no pose can come, None where they can."""
        return self._feed.trouble(self.body)

    def close(self) -> None:
        with _lock:
            last = self._feed.drop(self)
            if last:
                _feeds.pop(self._feed.key, None)
        if last:
            self._feed.end()


class Feed:
    """One system's program, and the thread that reads it. key: the system and its settings."""

    def __init__(self, key: tuple[str, str]) -> None:
        self.key = key
        self._wanted: tuple[BodySubscription, ...] = ()
        self._bodies: frozenset[str] = frozenset()
        self._reason: str | None = "no frame has come yet"
        self._has_come = False
        self._waker = Waker()
        self._thread = threading.Thread(target=self._run, name=f"mocap {key[0]}", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def add(self, body: str) -> BodySubscription:
        subscription = BodySubscription(self, body)
        self._wanted = (*self._wanted, subscription)
        return subscription

    def drop(self, subscription: BodySubscription) -> bool:
        """Forget a subscription; whether it was the last."""
        self._wanted = tuple(other for other in self._wanted if other is not subscription)
        return not self._wanted

    def end(self) -> None:
        self._waker.end()
        self._thread.join(5.0)

    def trouble(self, body: str) -> str | None:
        if self._reason is not None:
            return f"{self.key[0]}: {self._reason}"
        if body in self._bodies:
            return None
        others = ", ".join(f"`{name}`" for name in sorted(self._bodies)[:8])
        return f"{self.key[0]} sends no `{body}`, but {others}"

    def _run(self) -> None:
        pause = FIRST_PAUSE
        while not self._waker.ended.is_set():
            self._has_come = False
            try:
                self._ask()
            except Exception as error:  # no program could be begun, or it said what is no frame
                self._reason = described(error)
            self._waker.ended.wait(pause)
            pause = FIRST_PAUSE if self._has_come else min(2.0 * pause, LONGEST_PAUSE)
        self._waker.close()

    def _ask(self) -> None:
        """Begin the program and pass on what it says. Raises what goes wrong."""
        program = [sys.executable, "-m", "kybflow.sensors.motion_capture.child", *self.key]
        process = subprocess.Popen(
            program,
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        try:
            self._read(process)
        finally:
            process.kill()
            process.communicate()

    def _read(self, process: subprocess.Popen[bytes]) -> None:
        """Pass on what the program says, until it ends, falls silent or nobody listens."""
        assert process.stdout is not None
        waiting = b""
        with selectors.DefaultSelector() as selector:
            selector.register(process.stdout, selectors.EVENT_READ)
            selector.register(self._waker.ear, selectors.EVENT_READ)
            while not self._waker.ended.is_set():
                ready = [key.fileobj for key, _ in selector.select(SILENT)]
                if not ready:
                    self._reason = f"nothing heard for {SILENT:g} s"
                    return
                if process.stdout not in ready:
                    self._waker.hush()
                    continue
                data = process.stdout.read1(CHUNK)  # type: ignore[attr-defined]
                if not data:
                    self._reason = self._reason or "the link was lost"
                    return
                *lines, waiting = (waiting + data).split(b"\n")
                for line in lines:
                    self._tell(json.loads(line))

    def _tell(self, said: str | tuple[Time, Mapping[str, list[float]]]) -> None:
        if isinstance(said, str):
            self._reason = said
            return
        arrival, frame = said
        self._reason, self._has_come = None, True
        self._bodies |= frame.keys()
        for subscription in self._wanted:
            pose = frame.get(subscription.body)
            if pose is not None:
                px, py, pz, w, x, y, z = pose
                subscription.came.append(Arrived(arrival, (px, py, pz), (w, x, y, z)))


_feeds: dict[tuple[str, str], Feed] = {}
_lock = threading.Lock()


def subscribe(system: str, settings: Mapping[str, str], body: str) -> BodySubscription:
    """Ask a system for a body, by the one program that asks it for all."""
    key = system, json.dumps(settings, sort_keys=True)
    with _lock:
        feed = _feeds.get(key)
        if feed is None:
            feed = _feeds[key] = Feed(key)
            feed.start()
        return feed.add(body)
