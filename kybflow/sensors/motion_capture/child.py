"""The program that asks libmotioncapture, apart from the one that flies.

Its `connect` can wait for ever, and does so without letting go of Python's lock: in a thread it
would stop everything, the vehicles' commands first. It also prints what it likes. So it runs in
here, and each frame goes out as a line of JSON: `[ns of the monotonic clock, {name: [x, y, z, qw,
qx, qy, qz]}]`; a refusal as a text.

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
    """Frames until nobody reads them any more."""
    _follow()
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # what the library prints is no frame
    with contextlib.suppress(BrokenPipeError, KeyboardInterrupt):
        try:
            import motioncapture  # only this program needs the package
        except ImportError:
            _say(out, "the package `motioncapture` is missing: pip install kybflow[mocap]")
            return
        try:
            capture = motioncapture.connect(system, settings)
            while True:
                capture.waitForNextFrame()
                frame = {name: _numbers(body) for name, body in capture.rigidBodies.items()}
                if frame:
                    _say(out, [time.monotonic_ns(), frame])
        except RuntimeError as error:
            _say(out, str(error))


def _follow() -> None:
    """End with the thread that began this program, even where the library waits for ever."""
    with contextlib.suppress(AttributeError, OSError):  # Linux alone has it
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def _numbers(body: object) -> list[float]:
    q = body.rotation  # type: ignore[attr-defined]
    position = body.position  # type: ignore[attr-defined]
    return [float(x) for x in (*position, q.w, q.x, q.y, q.z)]


def _say(out: IO[str], what: object) -> None:
    out.write(json.dumps(what) + "\n")
    out.flush()


if __name__ == "__main__":
    main(sys.argv[1], json.loads(sys.argv[2]))
