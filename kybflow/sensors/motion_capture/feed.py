"""Poses from motion-capture systems. Each system has one process and one thread, shared by all its
subscriptions. The process is restarted when it ends or stops sending."""

from __future__ import annotations

import json
import selectors
import subprocess
import sys
import threading
from collections.abc import Mapping

from kybflow.core.errors import described
from kybflow.core.signals import Time
from kybflow.sensors._stream import CHUNK, PoseSource, TrackerPose, Waker

SILENCE_S = 10.0
"""Seconds without data after which the process is restarted."""
FIRST_PAUSE, LONGEST_PAUSE = 1.0, 8.0
"""Pauses before a restart, seconds; doubled as long as no frame arrives."""


class BodySubscription(PoseSource):
    """A subscription to one body of a system."""

    def __init__(self, feed: Feed, body: str) -> None:
        super().__init__()
        self.body = body
        self._feed = feed

    def trouble(self) -> str | None:
        return self._feed.trouble(self.body)

    def close(self) -> None:
        with _lock:
            last = self._feed.drop(self)
            if last:
                _feeds.pop(self._feed.key, None)
        if last:
            self._feed.end()


class Feed:
    """The process of one system, and the thread that reads its output. key: the system and its
    settings."""

    def __init__(self, key: tuple[str, str]) -> None:
        self.key = key
        self._wanted: tuple[BodySubscription, ...] = ()
        self._bodies: frozenset[str] = frozenset()
        self._reason: str | None = "no frame has arrived yet"
        self._has_data = False
        self._waker = Waker()
        self._thread = threading.Thread(target=self._run, name=f"mocap {key[0]}", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def add(self, body: str) -> BodySubscription:
        subscription = BodySubscription(self, body)
        self._wanted = (*self._wanted, subscription)
        return subscription

    def drop(self, subscription: BodySubscription) -> bool:
        """Remove a subscription; return whether it was the last."""
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
            self._has_data = False
            try:
                self._run_program()
            except Exception as error:  # the program did not start, or wrote no frame
                self._reason = described(error)
            self._waker.ended.wait(pause)
            pause = FIRST_PAUSE if self._has_data else min(2.0 * pause, LONGEST_PAUSE)
        self._waker.close()

    def _run_program(self) -> None:
        """Run the process and deliver its frames until it ends. Exceptions are passed on."""
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
        """Deliver frames until the process ends or sends nothing for `SILENCE_S`, or `end`
        is called."""
        assert process.stdout is not None
        waiting = b""
        with selectors.DefaultSelector() as selector:
            selector.register(process.stdout, selectors.EVENT_READ)
            selector.register(self._waker.receiver, selectors.EVENT_READ)
            while not self._waker.ended.is_set():
                ready = [key.fileobj for key, _ in selector.select(SILENCE_S)]
                if not ready:
                    self._reason = f"no data for {SILENCE_S:g} s"
                    return
                if process.stdout not in ready:
                    self._waker.drain()
                    continue
                data = process.stdout.read1(CHUNK)  # type: ignore[attr-defined]
                if not data:
                    self._reason = self._reason or "the connection was lost"
                    return
                *lines, waiting = (waiting + data).split(b"\n")
                for line in lines:
                    self._deliver(json.loads(line))

    def _deliver(self, message: str | tuple[Time, Mapping[str, list[float]]]) -> None:
        if isinstance(message, str):
            self._reason = message
            return
        arrival, frame = message
        self._reason, self._has_data = None, True
        self._bodies |= frame.keys()
        for subscription in self._wanted:
            pose = frame.get(subscription.body)
            if pose is not None:
                px, py, pz, w, x, y, z = pose
                subscription.poses.append(TrackerPose(arrival, arrival, (px, py, pz), (w, x, y, z)))


_feeds: dict[tuple[str, str], Feed] = {}
_lock = threading.Lock()


def subscribe(system: str, settings: Mapping[str, str], body: str) -> BodySubscription:
    """Return a subscription to a body. One process serves all bodies of a motion-capture system."""
    key = system, json.dumps(settings, sort_keys=True)
    with _lock:
        feed = _feeds.get(key)
        if feed is None:
            feed = _feeds[key] = Feed(key)
            feed.start()
        return feed.add(body)
