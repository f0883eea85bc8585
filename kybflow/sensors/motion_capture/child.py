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
    with contextlib.suppress(AttributeError, OSError):  # Linux only
        # end with the thread that started this process, even if the library blocks forever
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
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
                frame: dict[str, list[float]] = {}
                for name, body in capture.rigidBodies.items():
                    q = body.rotation
                    frame[name] = [float(x) for x in (*body.position, q.w, q.x, q.y, q.z)]
                if frame:
                    _write(out, [time.monotonic_ns(), frame])
        except RuntimeError as error:
            _write(out, str(error))


def _write(out: IO[str], what: object) -> None:
    out.write(json.dumps(what) + "\n")
    out.flush()


if __name__ == "__main__":
    main(sys.argv[1], json.loads(sys.argv[2]))
