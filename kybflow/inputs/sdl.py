"""Gamepads and joysticks through SDL; the only module that uses pygame.

SDL is global to the process and must be called from one thread, which runs while any pad is open.
The thread polls every 4 ms, passes every pad's state to the listeners, and detects pads that are
plugged in or unplugged. A controller that SDL recognizes has the names of an Xbox controller,
whatever is printed on it; other devices have numbered axes, buttons and hats.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any, NamedTuple

from kybflow.core.errors import DriverError, described

PAD_AXES = ("left_x", "left_y", "right_x", "right_y", "left_trigger", "right_trigger")
PAD_BUTTONS = (
    "a", "b", "x", "y", "back", "guide", "start", "left_stick", "right_stick", "left_shoulder",
    "right_shoulder", "dpad_up", "dpad_down", "dpad_left", "dpad_right",
)  # fmt: skip
"""The buttons, in the order of SDL's numbers."""
NUMBERS = 32
"""Largest number of axes and of buttons of an unknown device."""
POLL_PERIOD_S = 0.004
"""Polling period, seconds."""
_FULL_SCALE = 32767
_HATS = (("hat_left", 0, -1), ("hat_right", 0, 1), ("hat_down", 1, -1), ("hat_up", 1, 1))
_SETTINGS = {
    "SDL_VIDEODRIVER": "dummy",
    "SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS": "1",
    "SDL_NO_SIGNAL_HANDLERS": "1",
    "PYGAME_HIDE_SUPPORT_PROMPT": "1",
}


class PadState(NamedTuple):
    """The state of a device. axes: -1 to 1, positive down and right, as in SDL. held: the buttons
    that are held now or were pressed since the last poll."""

    name: str
    axes: Mapping[str, float]
    held: frozenset[str]


Listener = Callable[[tuple[PadState, ...]], None]
"""A function that receives the state of every plugged-in device, in SDL's thread."""


def listen(listener: Listener) -> None:
    """Add a listener. Raises DriverError if SDL can't be used."""
    with _LOCK:
        if not _LISTENERS:
            thread = _SdlThread()
            _LISTENERS.append(listener)
            thread.start()
            thread.began.wait(10.0)
            if thread.failed is not None:
                _LISTENERS.remove(listener)
                raise DriverError(thread.failed)
            _THREADS.append(thread)
        else:
            _LISTENERS.append(listener)


def ignore(listener: Listener) -> None:
    """Remove a listener. Removing the last one ends SDL's thread."""
    with _LOCK:
        _LISTENERS.remove(listener)
        if not _LISTENERS:
            _THREADS.pop().join(10.0)


_LOCK = threading.Lock()
_LISTENERS: list[Listener] = []
_THREADS: list[threading.Thread] = []


class _SdlThread(threading.Thread):
    """The thread that uses SDL. began: set when SDL works or has failed. failed: why SDL can't be
    used."""

    def __init__(self) -> None:
        super().__init__(name="SDL", daemon=True)
        self.began = threading.Event()
        self.failed: str | None = None
        self._pads: dict[int, _Pad] = {}

    def run(self) -> None:
        try:
            os.environ.update(_SETTINGS)
            import pygame
            from pygame._sdl2 import controller
        except ImportError:
            self.failed = "gamepads need `pip install 'kybflow[inputs]'`"
            self.began.set()
            return
        try:
            pygame.display.init()
            pygame.joystick.init()
            controller.init()
            self._poll(pygame, controller)
        except Exception as error:  # SDL may refuse in its own words
            self.failed = f"SDL can't be used: {described(error)}"
            self.began.set()
            return
        self.began.set()
        time.sleep(POLL_PERIOD_S)
        while _LISTENERS:
            self._poll(pygame, controller)
            time.sleep(POLL_PERIOD_S)
        self._pads.clear()
        controller.quit()
        pygame.joystick.quit()
        pygame.display.quit()

    def _poll(self, pygame: Any, controller: Any) -> None:
        """Process SDL's events, and pass the states to the listeners."""
        for event in pygame.event.get():
            if event.type == pygame.JOYDEVICEADDED:
                with suppress(pygame.error):  # it may be unplugged again
                    pad = _Pad(pygame, controller, event.device_index)
                    self._pads[pad.number] = pad
            elif event.type == pygame.JOYDEVICEREMOVED:
                self._pads.pop(event.instance_id, None)
            elif event.type == pygame.CONTROLLERBUTTONDOWN and event.instance_id in self._pads:
                self._pads[event.instance_id].press(event.button, known=True)
            elif event.type == pygame.JOYBUTTONDOWN and event.instance_id in self._pads:
                self._pads[event.instance_id].press(event.button, known=False)
        states = tuple(pad.state() for pad in self._pads.values())
        for listener in tuple(_LISTENERS):
            listener(states)


class _Pad:
    """A plugged-in device. number: SDL's instance id."""

    def __init__(self, pygame: Any, controller: Any, index: int) -> None:
        self._joystick = pygame.joystick.Joystick(index)
        self.number: int = self._joystick.get_instance_id()
        self._controller: Any = None
        self._name: str = self._joystick.get_name()
        if controller.is_controller(index):
            self._controller = controller.Controller(index)
            self._name = self._controller.name
        self._pressed: set[str] = set()

    def press(self, button: int, *, known: bool) -> None:
        """Record the press of a button, by SDL's number."""
        if known is (self._controller is not None):
            names = PAD_BUTTONS if known else tuple(f"button{i}" for i in range(NUMBERS))
            self._pressed.update(names[button : button + 1])

    def state(self) -> PadState:
        held, self._pressed = self._pressed, set()
        if self._controller is not None:
            pad = self._controller
            axes = {name: pad.get_axis(i) / _FULL_SCALE for i, name in enumerate(PAD_AXES)}
            held |= {name for i, name in enumerate(PAD_BUTTONS) if pad.get_button(i)}
        else:
            pad = self._joystick
            buttons = min(pad.get_numbuttons(), NUMBERS)
            axes = {f"axis{i}": pad.get_axis(i) for i in range(min(pad.get_numaxes(), NUMBERS))}
            held |= {f"button{i}" for i in range(buttons) if pad.get_button(i)}
            hats = [pad.get_hat(i) for i in range(min(pad.get_numhats(), 1))]
            held |= {name for hat in hats for name, axis, way in _HATS if hat[axis] == way}
        clipped = {name: max(-1.0, min(1.0, value)) for name, value in axes.items()}
        return PadState(self._name, clipped, frozenset(held))
