"""Builds the inputs of a vehicle's parts: a `Tick` in every tick, and an `Entry` when a behavior
begins."""

from __future__ import annotations

from kybflow.core.signals import (
    NOBODY,
    NS,
    Estimate,
    InputReadings,
    SeenObstacles,
    Tick,
    Time,
    made,
)
from kybflow.parts import GROUND, Entry, Flight
from kybflow.runtime.fleet.broadcasts import Broadcasts
from kybflow.runtime.vehicle.control import Control
from kybflow.runtime.vehicle.knowledge import Knowledge
from kybflow.world.vehicle_context import VehicleContext


class TickBuilder:
    """Builds the ticks and entries of one vehicle. fleet: the estimate of each vehicle in the
    newest tick, None for a vehicle without an estimate."""

    def __init__(
        self,
        context: VehicleContext,
        knowledge: Knowledge,
        control: Control,
        inputs: InputReadings,
        broadcasts: Broadcasts | None,
        moving: SeenObstacles,
    ) -> None:
        self.fleet: dict[str, Estimate | None] = {}
        self._context, self._knowledge, self._control = context, knowledge, control
        self._inputs, self._moving = inputs, moving
        self._neighbours = broadcasts or NOBODY

    def tick(self, now: Time, dt: float, entered: Time, fleet: dict[str, Estimate | None]) -> Tick:
        """Return the tick at `now`, `dt` seconds after the last one, of a vehicle whose state was
        entered at `entered`."""
        self.fleet = fleet
        knowledge, link = self._knowledge, self._knowledge.link_in
        return made(
            Tick,
            (
                now, dt, (now - entered) / NS, knowledge.estimate, knowledge.battery,
                self._control.followed, fleet, knowledge.imu, link.age, link.delay,
                knowledge.payload.state, self._inputs, self._neighbours, self._moving,
            ),
        )  # fmt: skip

    def standing(self, entered: Time, fleet: dict[str, Estimate | None]) -> Tick:
        """Return a tick of zero duration at the time of the newest measurements. fleet: the
        estimates of all vehicles."""
        now = self._knowledge.now
        return self.tick(now, 0.0, entered, self.fleet)._replace(fleet=fleet)

    def entry(self, flight: Flight) -> Entry:
        """Return the conditions in which a behavior would be entered now. The hover thrust (N) is
        the tracker's estimate in the air, and the airframe's weight on the ground."""
        knowledge, control, context = self._knowledge, self._control, self._context
        thrust = context.airframe.hover_thrust if flight is GROUND else control.hover_thrust()
        lift = knowledge.resting.specific_force
        return Entry(
            knowledge.now, context, knowledge.estimate, control.followed, thrust, flight, lift,
            self._inputs,
        )  # fmt: skip
