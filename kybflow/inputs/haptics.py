"""Haptic devices: their interface, and an energy tank that keeps their forces passive.

A force f gives the hand the energy f . dx while the hand moves by dx in a sample. A tank with the
energy E, which starts at `INITIAL_ENERGY` and never exceeds `MAX_ENERGY`, gains the energy that the
hand puts in and loses the energy that the hand receives:

    E' = min(E - f . dx, MAX_ENERGY)

The force is limited so that even the fastest hand can't take more than the tank's energy in the
next sample, |f| v_max MAX_SAMPLE_S <= E. Whatever force is commanded, the device therefore never
returns more energy than was put in plus `INITIAL_ENERGY`, if no sample of the servo is longer than
`MAX_SAMPLE_S`; any excess is taken back. (J. Ryu, D.-S. Kwon, B. Hannaford, "Stable Teleoperation
with Time-Domain Passivity Control", 2004, observe the energy likewise, and dissipate the excess
afterwards.) An empty tank makes forces weak, not zero; moving against them refills it.

The servo has its own clock, so that a late tick neither prolongs a force nor draws energy. A force
that the tick commands lasts for `HOLD_TIME_S` and then fades within `FADE_TIME_S` to damping alone.

Units are metres, newtons and seconds. The axes are x forward, y left and z up, as seen by a person
at the device.
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

INITIAL_ENERGY, MAX_ENERGY = 0.05, 0.5
"""Initial and largest energy of the tank, joules."""
MAX_SPEED = 1.5
"""Largest speed of a hand, m/s."""
SERVO_PERIOD_NS: Time = NS // 500
"""Period in which the servo sets the force."""
MAX_SAMPLE_S = 0.01
"""Longest sample of the servo, seconds."""
HOLD_TIME_S, FADE_TIME_S = 0.1, 0.1
"""Time for which a force holds without a new command, and time in which it then fades, seconds."""
_RETRY_PERIOD_S = 0.05
_NAMES = tuple(f"button{i}" for i in range(4))


class HapticState(NamedTuple):
    position: Vec3
    velocity: Vec3
    held: frozenset[str] = frozenset()


class HapticDevice(Protocol):
    """A haptic device. Every method may raise DriverError."""

    def read(self, now: Time) -> HapticState:
        """Return the device's state."""

    def apply_force(self, force: Vec3) -> None:
        """Apply a force to the hand from now on, N."""

    def close(self) -> None:
        """Release the hand and the device."""


class HapticSample(NamedTuple):
    """A sample of the servo: the device's state, and the force set. at: time of the servo's
    clock."""

    state: HapticState
    force: Vec3
    at: Time


ForceLaw = Callable[[Vec3, HapticState, float], Vec3]
"""Returns the force for a push, a state, and a factor, 0 to 1, on everything except the damping."""


class EnergyTank:
    """Limits forces so that the device stays passive. energy: the tank's energy, joules."""

    def __init__(self) -> None:
        self.energy = INITIAL_ENERGY
        self._force = ZERO
        self._before: Vec3 | None = None

    def passed(self, force: Vec3, state: HapticState) -> Vec3:
        """Return the force, limited so that the tank can't fall below zero by the next sample."""
        if self._before is not None:
            work = dot(self._force, sub(state.position, self._before))
            self.energy = min(self.energy - work, MAX_ENERGY)
        self._before = state.position
        most = self.energy / (MAX_SPEED * MAX_SAMPLE_S)
        self._force = shortened(force, most) if most > 0.0 else ZERO
        return self._force


class Servo:
    """Sets the force of a device according to the tick's last command.

    last: the last sample, None before the first. The engine's tick calls `apply_force` and
    `pressed` and reads `last`; the servo's thread calls `step`. They exchange immutable values.
    """

    def __init__(self, device: HapticDevice, law: ForceLaw) -> None:
        self.last: HapticSample | None = None
        self._device, self._law, self._tank = device, law, EnergyTank()
        self._command: tuple[Vec3 | None, Time] = (None, 0)
        self._push, self._share = ZERO, 0.0
        self._pressed = deque[frozenset[str]](maxlen=64)

    def apply_force(self, push: Vec3 | None, now: Time) -> None:
        """Command a push at a time of the servo's clock; None lets everything except the damping
        fade."""
        self._command = (push, now)

    def pressed(self) -> frozenset[str]:
        """Return the buttons that were pressed since the last call."""
        return frozenset().union(*(self._pressed.popleft() for _ in range(len(self._pressed))))

    def step(self, now: Time) -> None:
        """Read the device and set its force, which is zero if reading fails. Raises the device's
        errors."""
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
        push, at = self._command
        fresh = push is not None and (now - at) / NS <= HOLD_TIME_S
        if push is not None and fresh and all(map(isfinite, push)):
            self._push = push
        change = dt / FADE_TIME_S if fresh else -dt / FADE_TIME_S
        self._share = max(0.0, min(1.0, self._share + change))
        return self._share


class ServoThread:
    """Steps the servo of a real device in a thread until `close`. trouble: why the last step
    failed; None if it succeeded."""

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
                self.trouble, wait = None, SERVO_PERIOD_NS / NS
            except Exception as error:  # an input must not stop the flight
                self.trouble, wait = described(error), _RETRY_PERIOD_S

    def close(self) -> None:
        self._ended.set()
        self._thread.join(1.0)


class SimulatedHand:
    """A simulated device with a hand that acts as a spring and damper on the device's mass. rows:
    the hand's target over time, as fractions of `reach`. reach: metres."""

    MASS, STIFFNESS, DAMPING = 0.2, 120.0, 6.0
    STEP: Time = NS // 2000

    def __init__(self, rows: tuple[InputRow, ...], reach: float) -> None:
        self._rows, self._reach, self._next = rows, reach, 0
        self._now: Time = 0
        self.force, self._position, self._velocity = ZERO, ZERO, ZERO
        self.given = 0.0
        """The energy that the hand has received, joules."""

    def read(self, now: Time) -> HapticState:
        dt = self.STEP / NS
        while self._now < now:
            row, before = self._row(), self._position
            goal = (row.axes["x"], row.axes["y"], row.axes["z"]) if row and not row.lost else ZERO
            pull = scale(sub(scale(goal, self._reach), before), self.STIFFNESS)
            pull = add(pull, scale(self._velocity, -self.DAMPING))
            push = scale(add(pull, self.force), dt / self.MASS)
            self._velocity = shortened(add(self._velocity, push), MAX_SPEED)
            self._position = add(before, scale(self._velocity, dt))
            self.given += dot(self.force, sub(self._position, before))
            self._now += self.STEP
        row = self._row()
        return HapticState(self._position, self._velocity, row.held if row else frozenset())

    def _row(self) -> InputRow | None:
        while self._next < len(self._rows) and self._rows[self._next].time <= self._now:
            self._next += 1
        return self._rows[self._next - 1] if self._next else None

    def apply_force(self, force: Vec3) -> None:
        self.force = force

    def close(self) -> None:
        self.force = ZERO


class ForceDimension:
    """A device of the series omega, delta, sigma or lambda of Force Dimension, through
    `forcedimension-core`, which needs the maker's SDK. The device's x points to the person, its y
    to the right."""

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
            raise DriverError("Force Dimension's device gives no position: is it switched on?")
        mask = dhd.getButtonMask()
        held = frozenset(name for bit, name in enumerate(_NAMES) if mask >> bit & 1)
        return HapticState(_to_user_axes(self._place), _to_user_axes(self._speed), held)

    def apply_force(self, force: Vec3) -> None:
        x, y, z = force
        if self._dhd.setForce([-x, -y, z]) < 0:
            raise DriverError("Force Dimension's device accepts no force")

    def close(self) -> None:
        self._dhd.setForce([0.0, 0.0, 0.0])
        self._dhd.enableForce(False)
        self._dhd.close()


def _to_user_axes(there: list[float]) -> Vec3:
    x, y, z = there
    return (-x, -y, z)
