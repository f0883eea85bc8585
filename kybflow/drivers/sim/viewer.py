"""MuJoCo's own viewer beside a running simulation, where there is a display."""

from __future__ import annotations

from typing import Any

from kybflow.core.errors import DriverError
from kybflow.core.signals import NS, Time

PERIOD: Time = NS // 60
LOOK_AT = (0.0, 0.0, 0.8)
DISTANCE = 5.0
"""Where the camera begins: a flight room of a few metres, seen from the south-east corner."""


class Viewer:
    """Shows the world 60 times a second of simulated time. Raises DriverError without a display."""

    def __init__(self, model: Any, data: Any) -> None:
        import warnings

        import glfw

        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            if not glfw.init():
                raise DriverError("--live needs a display, and there is none; fly without it")
        import mujoco.viewer

        self._handle = mujoco.viewer.launch_passive(
            model, data, show_left_ui=False, show_right_ui=False
        )
        with self._handle.lock():
            camera = self._handle.cam
            camera.lookat[:] = LOOK_AT
            camera.distance, camera.elevation, camera.azimuth = DISTANCE, -20.0, 135.0
        self._due: Time = 0

    def show(self, now: Time) -> None:
        if now >= self._due and self._handle.is_running():
            self._handle.sync()
            self._due = now + PERIOD

    def close(self) -> None:
        self._handle.close()
