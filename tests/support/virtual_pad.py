"""A gamepad that only SDL knows: its own virtual joystick, moved by a test."""

from __future__ import annotations

import ctypes
from functools import cache
from pathlib import Path
from typing import Any

_FULL = 32767
_CONTROLLER = 1
AXES = ("left_x", "left_y", "right_x", "right_y", "left_trigger", "right_trigger")


@cache
def _library() -> Any:
    """The SDL that pygame has loaded."""
    lines = Path("/proc/self/maps").read_text(encoding="utf-8").splitlines()
    paths = (line.split()[-1] for line in lines)
    library = ctypes.CDLL(next(p for p in paths if Path(p).name.startswith("libSDL2-2")))
    library.SDL_JoystickOpen.restype = ctypes.c_void_p
    library.SDL_JoystickOpen.argtypes = (ctypes.c_int,)
    library.SDL_JoystickSetVirtualAxis.argtypes = (ctypes.c_void_p, ctypes.c_int, ctypes.c_int16)
    library.SDL_JoystickSetVirtualButton.argtypes = (ctypes.c_void_p, ctypes.c_int, ctypes.c_uint8)
    return library


class VirtualPad:
    """Plugged in when it is made. kind: SDL's type; 1 is a gamepad that it knows, 0 something that
    it doesn't. SDL must have begun."""

    def __init__(self, kind: int = _CONTROLLER) -> None:
        self._sdl = _library()
        self._index: int = self._sdl.SDL_JoystickAttachVirtual(kind, len(AXES), 21, 0)
        assert self._index >= 0
        self._pad = self._sdl.SDL_JoystickOpen(self._index)
        assert self._pad
        for number in range(len(AXES)):
            self.move(number, 0.0)

    def move(self, axis: int, value: float) -> None:
        """Move an axis, by SDL's number; a positive value is right and down."""
        assert self._sdl.SDL_JoystickSetVirtualAxis(self._pad, axis, round(value * _FULL)) == 0

    def press(self, button: int, *, down: bool = True) -> None:
        assert self._sdl.SDL_JoystickSetVirtualButton(self._pad, button, down) == 0

    def unplug(self) -> None:
        assert self._sdl.SDL_JoystickDetachVirtual(self._index) == 0
