"""Runs libmotioncapture in a separate process.

The library's `connect` may block forever while it holds Python's lock, which would stop the
vehicles' commands if it ran in a thread. It also prints to stdout. The process writes each frame as
a line of JSON, `[ns of the monotonic clock, {name: [x, y, z, qw, qx, qy, qz]}]`, and an error as a
JSON string.

    python -m kybflow.sensors.motion_capture.child SYSTEM SETTINGS
"""

from __future__ import annotations

import contextlib
import ctypes
import json
import os
import signal
import sys
import time
from typing import IO

_PR_SET_PDEATHSIG = 1


def main(system: str, settings: dict[str, str]) -> None:
    """Write frames to stdout until the reader closes it."""
    _end_with_parent()
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # the library prints to stdout
    with contextlib.suppress(BrokenPipeError, KeyboardInterrupt):
        try:
            import motioncapture
        except ImportError:
            _write(out, "the package `motioncapture` is missing: pip install kybflow[mocap]")
            return
        try:
            capture = motioncapture.connect(system, settings)
            while True:
                capture.waitForNextFrame()
                frame = {name: _numbers(body) for name, body in capture.rigidBodies.items()}
                if frame:
                    _write(out, [time.monotonic_ns(), frame])
        except RuntimeError as error:
            _write(out, str(error))


def _end_with_parent() -> None:
    """Make this process end with the thread that started it, even if the library blocks forever."""
    with contextlib.suppress(AttributeError, OSError):  # Linux only
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def _numbers(body: object) -> list[float]:
    q = body.rotation  # type: ignore[attr-defined]
    position = body.position  # type: ignore[attr-defined]
    return [float(x) for x in (*position, q.w, q.x, q.y, q.z)]


def _write(out: IO[str], what: object) -> None:
    out.write(json.dumps(what) + "\n")
    out.flush()


if __name__ == "__main__":
    main(sys.argv[1], json.loads(sys.argv[2]))
