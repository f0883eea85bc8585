"""Devices that a hand moves and that push back: the interface, and what keeps their forces passive.

A force f that is held for a sample, while the hand moves by dx, gives it the energy f . dx. A tank
with the energy E, which begins with `RESERVE` and never holds more than `MOST`, is charged with
what the hand puts in and discharged by what it gets out:

    E' = min(E - f . dx, MOST)

A force is shortened so that even the fastest hand can't draw more than the tank has in the next
sample, |f| v_max LATEST <= E. So whatever the force was to be, of a vehicle, a delay or a mistake,
the device never gives out more energy than was put in and `RESERVE`, as long as the servo is never
later than `LATEST`; what it gives beyond that is taken back. (J. Ryu, D.-S. Kwon, B. Hannaford,
"Stable Teleoperation with Time-Domain Passivity Control", 2004, observe the energy in the same way,
and take back afterwards what was too much.) An empty tank makes forces weak, not zero: what the
hand does against them fills it again.

The servo has its own time, so that a late tick neither holds a force nor draws energy. What a tick
hands over holds for `HELD` and then fades in `FADE`, to damping alone.

Metres, newtons and seconds along x forward, y to the left, z up, as a person at the device sees it.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from math import isfinite
from typing import NamedTuple, Protocol

from kybflow.core.errors import DriverError, described
from kybflow.core.geometry import ZERO, Vec3, add, dot, scale, sub
from kybflow.core.signals import NS, Time
from kybflow.flight.governor import shortened
from kybflow.inputs.rows import InputRow

RESERVE, MOST = 0.05, 0.5
"""Joules in the tank at the beginning, and at most."""
FASTEST = 1.5
"""What no hand exceeds, m/s."""
STEP: Time = NS // 500
"""How often the servo sets the force."""
LATEST = 0.01
"""Seconds between two forces of the servo, at most."""
HELD, FADE = 0.1, 0.1
"""Seconds for which a force holds without a word of the tick, and in which it fades then."""
_RETRY = 0.05
_NAMES = tuple(f"button{i}" for i in range(4))


class HapticState(NamedTuple):
    """A device as it is now."""

    position: Vec3
    velocity: Vec3
    held: frozenset[str] = frozenset()


class HapticDevice(Protocol):
    """What every device can. Raises DriverError."""

    def read(self, now: Time) -> HapticState:
        """Return where it is."""

    def apply_force(self, force: Vec3) -> None:
        """Push the hand from now on."""

    def close(self) -> None:
        """Let go of the hand, and of the device."""


class HapticSample(NamedTuple):
    """What the servo did last, and the time of its clock."""

    state: HapticState
    force: Vec3
    at: Time


ForceLaw = Callable[[Vec3, HapticState, float], Vec3]
"""Gives the force for a push, a state, and the share, 0 to 1, to which all but damping counts."""


class EnergyTank:
    """Shortens forces so that the device stays passive. energy: what is in the tank, joules."""

    def __init__(self) -> None:
        self.energy = RESERVE
        self._force = ZERO
        self._before: Vec3 | None = None

    def passed(self, force: Vec3, state: HapticState) -> Vec3:
        """Return what may be given of `force` until the next sample."""
        if self._before is not None:
            work = dot(self._force, sub(state.position, self._before))
            self.energy = min(self.energy - work, MOST)
        self._before = state.position
        most = self.energy / (FASTEST * LATEST)
        self._force = shortened(force, most) if most > 0.0 else ZERO
        return self._force


class Servo:
    """Sets the force of a device from what the tick handed over last.

    last: the device's last reading, None before the first. The engine's tick calls `apply_force`
    and `pressed` and reads `last`; the thread of the servo calls `step`. They exchange immutable
    values only.
    """

    def __init__(self, device: HapticDevice, law: ForceLaw) -> None:
        self.last: HapticSample | None = None
        self._device, self._law, self._tank = device, law, EnergyTank()
        self._word: tuple[Vec3 | None, Time] = (None, 0)
        self._push, self._share = ZERO, 0.0
        self._pressed = deque[frozenset[str]](maxlen=64)

    def apply_force(self, push: Vec3 | None, now: Time) -> None:
        """Hand over a push at a time of the servo's clock; None: let all but damping fade."""
        self._word = (push, now)

    def pressed(self) -> frozenset[str]:
        """Return the buttons that went down since the last call."""
        return frozenset().union(*(self._pressed.popleft() for _ in range(len(self._pressed))))

    def step(self, now: Time) -> None:
        """Read the device and set its force; none where that fails. Raises what the device does."""
        try:
            state = self._device.read(now)
        except Exception:
            self._device.apply_force(ZERO)
            raise
        last, force = self.last, ZERO
        dt = 0.0 if last is None else (now - last.at) / NS
        if state.held != (frozenset() if last is None else last.state.held):
            self._pressed.append(state.held)
        if all(map(isfinite, (*state.position, *state.velocity))):
            share = self._shared(now, dt)
            force = self._tank.passed(self._law(self._push, state, share), state)
        self._device.apply_force(force)
        self.last = HapticSample(state, force, now)

    def _shared(self, now: Time, dt: float) -> float:
        push, at = self._word
        fresh = push is not None and (now - at) / NS <= HELD
        if push is not None and fresh and all(map(isfinite, push)):
            self._push = push
        change = dt / FADE if fresh else -dt / FADE
        self._share = max(0.0, min(1.0, self._share + change))
        return self._share


class ServoThread:
    """Keeps a servo's time beside a real device, in a thread of its own, until `close`.

    trouble: why the last step failed, None if it did not.
    """

    def __init__(self, servo: Servo) -> None:
        self.trouble: str | None = None
        self._servo, self._ended = servo, threading.Event()
        self._thread = threading.Thread(target=self._run, name="haptics", daemon=True)
        self._thread.start()

    def now(self) -> Time:
        """Return the time of the servo's clock."""
        return time.monotonic_ns()

    def _run(self) -> None:
        wait = 0.0
        while not self._ended.wait(wait):
            try:
                self._servo.step(self.now())
                self.trouble, wait = None, STEP / NS
            except Exception as error:  # an input must not stop the flight
                self.trouble, wait = described(error), _RETRY

    def close(self) -> None:
        """Stop it."""
        self._ended.set()
        self._thread.join(1.0)


class SimulatedHand:
    """A device in the simulation, and the hand that holds it: rows say where the hand wants it, as
    shares of `reach`. The hand is a spring and a damper on the device's mass."""

    MASS, STIFFNESS, DAMPING = 0.2, 120.0, 6.0
    STEP: Time = NS // 2000

    def __init__(self, rows: tuple[InputRow, ...], reach: float) -> None:
        self._rows, self._reach, self._next = rows, reach, 0
        self._now: Time = 0
        self.force, self._position, self._velocity = ZERO, ZERO, ZERO
        self.given = 0.0
        """The energy that the device has given the hand, joules."""

    def read(self, now: Time) -> HapticState:
        while self._now < now:
            self._advance()
        row = self._row()
        return HapticState(self._position, self._velocity, row.held if row else frozenset())

    def _advance(self) -> None:
        dt, before = self.STEP / NS, self._position
        row = self._row()
        goal = (row.axes["x"], row.axes["y"], row.axes["z"]) if row and not row.lost else ZERO
        pull = scale(sub(scale(goal, self._reach), before), self.STIFFNESS)
        pull = add(pull, scale(self._velocity, -self.DAMPING))
        push = scale(add(pull, self.force), dt / self.MASS)
        self._velocity = shortened(add(self._velocity, push), FASTEST)
        self._position = add(before, scale(self._velocity, dt))
        self.given += dot(self.force, sub(self._position, before))
        self._now += self.STEP

    def _row(self) -> InputRow | None:
        while self._next < len(self._rows) and self._rows[self._next].time <= self._now:
            self._next += 1
        return self._rows[self._next - 1] if self._next else None

    def apply_force(self, force: Vec3) -> None:
        self.force = force

    def close(self) -> None:
        self.force = ZERO


class ForceDimension:
    """An omega, delta, sigma or lambda of Force Dimension, by `forcedimension-core`, which needs
    the maker's SDK. The device's x points to the person, its y to the right."""

    def __init__(self) -> None:
        try:
            from forcedimension_core import dhd
        except (ImportError, OSError) as error:
            hint = "`pip install 'kybflow[haptics]'` and the maker's SDK (FDSDK)"
            raise DriverError(f"Force Dimension's devices need {hint}: {error}") from error
        self._dhd = dhd
        if dhd.open() < 0:
            raise DriverError("no device of Force Dimension is found")
        dhd.enableForce(True)
        self._place, self._speed = [0.0] * 3, [0.0] * 3

    def read(self, now: Time) -> HapticState:
        dhd = self._dhd
        if min(dhd.getPosition(self._place), dhd.getLinearVelocity(self._speed)) < 0:
            raise DriverError("Force Dimension's device gives no position")
        mask = dhd.getButtonMask()
        held = frozenset(name for bit, name in enumerate(_NAMES) if mask >> bit & 1)
        return HapticState(_turned(self._place), _turned(self._speed), held)

    def apply_force(self, force: Vec3) -> None:
        x, y, z = force
        if self._dhd.setForce([-x, -y, z]) < 0:
            raise DriverError("Force Dimension's device takes no force")

    def close(self) -> None:
        self._dhd.setForce([0.0, 0.0, 0.0])
        self._dhd.enableForce(False)
        self._dhd.close()


def _turned(there: list[float]) -> Vec3:
    x, y, z = there
    return (-x, -y, z)
