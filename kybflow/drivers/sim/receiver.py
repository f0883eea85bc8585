"""Delivers commands to a simulated on-board controller. Its watchdog lands the vehicle when no
commands arrive."""

from __future__ import annotations

from collections import deque
from math import exp

from kybflow.core.geometry import LEVEL, ZERO
from kybflow.core.signals import NEVER, NS, Command, Time
from kybflow.drivers.sim.steps.onboard import AttitudeController
from kybflow.flight.descent import Descent
from kybflow.world.vehicle_context import Airframe

WATCHDOG_NS: Time = NS // 4
"""Time without a command after which an armed vehicle descends by itself."""
UPDATE_PERIOD: Time = NS // 5
"""Period in which the estimates of climb rate, bias and hover thrust are updated."""
CLIMB_MEMORY = 2.0
"""Time constant with which the integrated climb rate decays, s, so that an accelerometer bias of b
never becomes a climb rate of more than 2 b."""
AVERAGING_TIME = 5.0
"""Time constant for averaging the specific force and the commanded thrust in flight, s. Since the
commanded speed is bounded, the average force is gravity plus the current accelerometer bias, and
the average thrust is the hover thrust at the current mass and battery."""
MAX_BIAS = 2.0
"""Largest plausible accelerometer bias, m/s^2. A larger mean force since the last command counts as
motion."""
PRIOR_TIME = 1.0
"""Weight of the airframe's nominal weight in that average, seconds."""
HOVER_ERROR = 0.1
"""Largest error of the airframe's hover thrust, as a fraction of the vehicle's weight."""
LIFT_OFF = 0.9
"""Commanded thrust, relative to the airframe's weight, above which the vehicle counts as flying.
Thrust doesn't count while the mean force differs from that at rest by more than 1 m/s^2."""


class Receiver:
    """Passes commands to the on-board controller, `late` nanoseconds after they were sent. When
    commands stop, its watchdog levels the vehicle and descends (`kybflow.flight.descent`). During
    the descent it accepts only `stop`; afterwards it ignores commands until it receives a disarmed
    one."""

    def __init__(
        self, controller: AttitudeController, airframe: Airframe, has_watchdog: bool
    ) -> None:
        self.descent: Descent | None = None
        self.late: Time = 0
        self._controller, self._airframe, self._has_watchdog = controller, airframe, has_watchdog
        self._received_at = self._updated_at = 0
        self._ignores = False
        self._climb = self._bias = 0.0
        self._hover, self._flown = airframe.hover_thrust, 0.0
        self._thrust = self._impulse = 0.0
        self._counted: Time = 0
        self._delayed: deque[tuple[Time, Command, bool]] = deque()

    def set_delay(self, late: Time) -> None:
        """Delay commands by `late` from now on. If `late` is zero, commands still waiting because
        of an earlier delay are lost."""
        self.late = late
        if not late:
            self._delayed = deque(entry for entry in self._delayed if not entry[2])

    def delay(self, command: Command, now: Time, more: Time) -> Time:
        """Queue a command that arrives after `late` plus `more` nanoseconds. Return its time of
        arrival. Commands keep their order."""
        last = self._delayed[-1][0] if self._delayed else now
        due = max(last, now + self.late + more)
        self._delayed.append((due, command, self.late > 0))
        return due

    def receive(self, command: Command, now: Time) -> None:
        """Process a command that arrives now."""
        self._received_at = now
        if self._ignores:
            if command.armed or self.descent is not None:
                return
            self._ignores = False
        self._add_thrust(now)
        _, x, y, _ = command.attitude
        self._thrust = command.thrust * (1.0 - 2.0 * (x * x + y * y))
        self._controller.receive(command)

    def _add_thrust(self, now: Time) -> None:
        """Add the commanded upward thrust until now to its integral."""
        self._impulse += self._thrust * (now - self._counted)
        self._counted = now

    def stop(self) -> None:
        """Stop the rotors at once."""
        self._ignores, self.descent = False, None
        self._controller.receive(Command(LEVEL, 0.0, ZERO, None, False))

    def update(self, now: Time) -> Time:
        """Process the newest command that has arrived, and start the descent if none has arrived
        for too long. Return the time of the next call; a command that arrives doesn't require an
        earlier call."""
        waiting, newest = self._delayed, None
        while waiting and waiting[0][0] <= now:
            newest = waiting.popleft()[1]
        if newest is not None:
            self.receive(newest, now)
        due = waiting[0][0] if waiting else NEVER
        if not self._has_watchdog:
            return due
        if not self._controller.armed:
            self._climb = self._bias = 0.0
            self._hover, self._flown = self._airframe.hover_thrust, 0.0
        elif not self._ignores:
            is_silent = now - self._received_at >= WATCHDOG_NS
            if is_silent or now - self._updated_at >= UPDATE_PERIOD:
                self._check(now, is_silent)
            if not is_silent:
                return min(due, self._received_at + WATCHDOG_NS)
        return min(due, now + WATCHDOG_NS)

    def _check(self, now: Time, is_silent: bool) -> None:
        """Update the estimates of climb rate, bias and hover thrust, and start the descent if
        commands have stopped."""
        self._add_thrust(now)
        self._updated_at, bias = now, self._bias
        gained, seconds = self._controller.gained()
        keep, impulse = exp(-seconds / AVERAGING_TIME), self._impulse / NS
        self._impulse = 0.0
        if seconds > 0.0:
            self._bias = keep * self._bias + (1.0 - keep) * gained / seconds
            if impulse > LIFT_OFF * self._airframe.hover_thrust * seconds and abs(gained) < seconds:
                self._flown += seconds
                share = seconds / min(self._flown + PRIOR_TIME, AVERAGING_TIME)
                self._hover += share * (impulse / seconds - self._hover)
        self._climb = self._climb * exp(-seconds / CLIMB_MEMORY) + gained - self._bias * seconds
        if is_silent:
            if abs(gained) < MAX_BIAS * seconds:
                bias = self._bias
            most, rest = self._airframe.max_thrust, self._controller.rest + bias
            hover_error = HOVER_ERROR * exp(-2.0 * self._flown / AVERAGING_TIME)
            self.descent = Descent(self._hover, most, self._climb, rest, hover_error)
            self._ignores = True

    def come_down(self, lift: float, dt: float) -> None:
        """Make one step of the descent, `dt` seconds long. lift: specific force along body z,
        m/s^2."""
        if self.descent is None:
            return
        thrust = self.descent.step(lift, dt)
        self._controller.receive(Command(LEVEL, thrust or 0.0, ZERO, None, thrust is not None))
        if thrust is None:
            self.descent = None
