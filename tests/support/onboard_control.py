"""A simulated vehicle whose on-board controller follows setpoints or body rates, as an autopilot
does; for tests of what is sent to one."""

from __future__ import annotations

from plans import NANO, Through, wrapped

from kybflow.core.geometry import heading_of
from kybflow.core.signals import (
    NS,
    Command,
    CommandKind,
    Estimate,
    Tick,
    Time,
    Truth,
)
from kybflow.dsl.plan import PartPlan
from kybflow.parts import Link
from kybflow.runtime.trackers.cascade import Cascade, CascadeParams
from kybflow.world.vehicle_context import VehicleContext

RATES = frozenset({CommandKind.RATES_THRUST, CommandKind.ATTITUDE_THRUST})
SETPOINTS = frozenset({CommandKind.POSITION, CommandKind.VELOCITY, CommandKind.ACCELERATION})


class Follows(Through):
    """What it is sent stands in `kinds`. It flies on the truth, as on a perfect estimate: setpoints
    by the law of `cascade`; rates by holding the attitude that it has, so that only the rates act;
    attitudes as they are."""

    def __init__(self, name: str, link: Link) -> None:
        super().__init__(link)
        self.kinds: set[CommandKind] = set()
        context = VehicleContext(name, NANO, (0.0, 0.0, 0.0), 0.0, None, 0.004)
        self._tracker = Cascade(CascadeParams(), context)
        self._last: Time = 0

    def send(self, command: Command, now: Time) -> None:
        if command.armed:
            self.kinds.add(command.kind)
        truth = self.truth()
        assert truth is not None
        if command.armed and command.kind is CommandKind.RATES_THRUST:
            heading = heading_of(truth.attitude)
            command = command._replace(attitude=truth.attitude, heading=heading)
        elif command.armed and command.setpoint is not None:
            command = self._follow(command, truth, now)
        super().send(command, now)

    def _follow(self, command: Command, truth: Truth, now: Time) -> Command:
        assert command.setpoint is not None
        assert command.setpoint.kind.value == command.kind.value
        place, speed, attitude, turn, _ = truth
        known = Estimate(now, place, speed, attitude, turn, "own", 0.0, 0.0)
        dt, self._last = (now - self._last) / NS, now
        tick = Tick(now, dt, 0.0, known, None, command.setpoint, {})
        return self._tracker.update(command.setpoint, tick)


def following(accepts: frozenset[CommandKind] = SETPOINTS) -> tuple[PartPlan, dict[str, Follows]]:
    """(the driver, the links that it opened)"""
    opened: dict[str, Follows] = {}

    def wrap(name: str, link: Link) -> Link:
        opened[name] = Follows(name, link)
        return opened[name]

    return wrapped(wrap, accepts=accepts), opened
