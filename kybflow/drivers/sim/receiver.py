"""How commands reach a simulated on-board controller, and what happens when none does any more."""

from __future__ import annotations

from collections import deque
from math import exp

from kybflow.core.geometry import LEVEL, ZERO
from kybflow.core.signals import NEVER, NS, Command, Time
from kybflow.drivers.sim.steps.onboard import AttitudeController
from kybflow.flight.descent import Descent
from kybflow.world.vehicle_context import Airframe

WATCHDOG: Time = NS // 4
"""How long an armed vehicle waits for a command before it comes down by itself."""
FEELS: Time = NS // 5
"""How often it takes stock of what was felt."""
FORGOTTEN = 2.0
"""Seconds in which a speed that the IMU has felt is forgotten: an accelerometer that is wrong by b
is never mistaken for more than 2 b, however long the flight."""
LEARNT = 5.0
"""Seconds over which the specific force and the commanded thrust are averaged in flight. Who
commands the vehicle keeps its speed bounded, so that in the long run the force is gravity and what
the accelerometer is wrong by now, whatever it felt at rest, and the thrust is what carries the
vehicle as it is, on the battery that it has."""
MOTION = 2.0
"""No accelerometer is wrong by more, m/s^2: since the last command, when nobody holds the speed any
more, such a force is motion."""
SETTLED = 1.0
"""Seconds for which the airframe's weight counts in that average."""
UNSURE = 0.1
"""The part of a vehicle's weight that the thrust of its airframe's may not carry."""
LEAVES = 0.9
"""The thrust over the airframe's weight from which it may fly. What is asked for while the mean
force differs from that at rest by more than 1 m/s^2 doesn't count: it carries no weight."""


class Receiver:
    """Hands commands to the on-board controller, `late` nanoseconds after they were sent. When
    nothing arrives for too long its watchdog levels out and comes down by the law of
    `kybflow.flight.descent`. Until it is down it heeds nothing but `stop`, and afterwards it waits
    for a command that is not armed."""

    def __init__(self, controller: AttitudeController, airframe: Airframe, watched: bool) -> None:
        self.descent: Descent | None = None
        self.late: Time = 0
        self._controller, self._airframe, self._watched = controller, airframe, watched
        self._heard = self._felt = 0
        self._deaf = False
        self._climb = self._wrong = 0.0
        self._hover, self._flown = airframe.hover_thrust, 0.0
        self._thrust = self._asked = 0.0
        self._counted: Time = 0
        self._on_the_way: deque[tuple[Time, Command, bool]] = deque()

    def put_off(self, late: Time) -> None:
        """From now on what is sent arrives `late`; what was put off is lost when that is zero."""
        self.late = late
        if not late:
            self._on_the_way = deque(entry for entry in self._on_the_way if not entry[2])

    def delay(self, command: Command, now: Time, more: Time) -> Time:
        """A command is sent at `now` and arrives late, by `more` beside: when. None overtakes
        another."""
        last = self._on_the_way[-1][0] if self._on_the_way else now
        due = max(last, now + self.late + more)
        self._on_the_way.append((due, command, self.late > 0))
        return due

    def hear(self, command: Command, now: Time) -> None:
        """A command arrives."""
        self._heard = now
        if self._deaf:
            if command.armed or self.descent is not None:
                return
            self._deaf = False
        self._count(now)
        _, x, y, _ = command.attitude
        self._thrust = command.thrust * (1.0 - 2.0 * (x * x + y * y))
        self._controller.receive(command)

    def _count(self, now: Time) -> None:
        """The upward thrust that was asked for until now counts."""
        self._asked += self._thrust * (now - self._counted)
        self._counted = now

    def stop(self) -> None:
        """Stop the rotors at once."""
        self._deaf, self.descent = False, None
        self._controller.receive(Command(LEVEL, 0.0, ZERO, None, False))

    def mind(self, now: Time) -> Time:
        """Take what has arrived, the newest counts; begin to come down when nothing was heard for
        too long. When it wants to be called again; a command that arrives makes that no earlier."""
        waiting, newest = self._on_the_way, None
        while waiting and waiting[0][0] <= now:
            newest = waiting.popleft()[1]
        if newest is not None:
            self.hear(newest, now)
        due = waiting[0][0] if waiting else NEVER
        if not self._watched:
            return due
        if not self._controller.armed:
            self._climb = self._wrong = 0.0
            self._hover, self._flown = self._airframe.hover_thrust, 0.0
        elif not self._deaf:
            is_silent = now - self._heard >= WATCHDOG
            if is_silent or now - self._felt >= FEELS:
                self._take_stock(now, is_silent)
            if not is_silent:
                return min(due, self._heard + WATCHDOG)
        return min(due, now + WATCHDOG)

    def _take_stock(self, now: Time, is_silent: bool) -> None:
        """Take what was felt and asked for; begin to come down where nobody is heard any more."""
        self._count(now)
        self._felt, wrong = now, self._wrong
        gained, seconds = self._controller.gained()
        self._feel(gained, seconds)
        if is_silent:
            if abs(gained) < MOTION * seconds:
                wrong = self._wrong
            most, rest = self._airframe.max_thrust, self._controller.rest + wrong
            unsure = UNSURE * exp(-2.0 * self._flown / LEARNT)
            self.descent = Descent(self._hover, most, self._climb, rest, unsure)
            self._deaf = True

    def _feel(self, gained: float, seconds: float) -> None:
        """Take the upward speed that the IMU has felt in flight, m/s, in so many seconds, and the
        thrust that was asked for meanwhile."""
        keep, asked = exp(-seconds / LEARNT), self._asked / NS
        self._asked = 0.0
        if seconds > 0.0:
            self._wrong = keep * self._wrong + (1.0 - keep) * gained / seconds
            if asked > LEAVES * self._airframe.hover_thrust * seconds and abs(gained) < seconds:
                self._flown += seconds
                share = seconds / min(self._flown + SETTLED, LEARNT)
                self._hover += share * (asked / seconds - self._hover)
        self._climb = self._climb * exp(-seconds / FORGOTTEN) + gained - self._wrong * seconds

    def come_down(self, lift: float, dt: float) -> None:
        """One step of the descent, with the specific force along body z that is felt, m/s^2."""
        if self.descent is None:
            return
        thrust = self.descent.step(lift, dt)
        self._controller.receive(Command(LEVEL, thrust or 0.0, ZERO, None, thrust is not None))
        if thrust is None:
            self.descent = None
