"""What a vehicle is sent: commands once it is armed, its payload's servo, and its own land mode."""

from __future__ import annotations

from kybflow.core.errors import Refused
from kybflow.core.geometry import LEVEL, ZERO
from kybflow.core.signals import Command, Grip, Time
from kybflow.dsl.plan import VehiclePlan
from kybflow.runtime.events import Events
from kybflow.runtime.vehicle.activity import Activity
from kybflow.runtime.vehicle.link import LinkOut
from kybflow.runtime.vehicle.payload import PayloadTracker
from kybflow.runtime.vehicle.resting_bias import RestingBias

RESTING = Command(LEVEL, 0.0, ZERO, None, False)
"""What a vehicle on the ground is sent: rotors at rest."""


class CommandOutput:
    """sent: the last command. arming: the command for which the vehicle is being armed, None when
    it is not; the behavior's time stands still meanwhile."""

    def __init__(
        self,
        plan: VehiclePlan,
        link: LinkOut,
        activity: Activity,
        payload: PayloadTracker,
        resting: RestingBias,
        events: Events,
    ) -> None:
        self.sent = RESTING
        self.arming: Command | None = None
        self._name, self._link, self._activity, self._events = plan.name, link, activity, events
        self._payload, self._resting = payload, resting

    def deliver(self, command: Command, now: Time) -> Command:
        """Hand the command of a tick to the link; return what was sent. A vehicle on the ground
        that is asked for thrust is armed first, which may take seconds; meanwhile, and when it
        refuses, its rotors rest."""
        if self._activity.land_mode is None:
            if command.armed and not self.sent.armed and not self._armed(command, now):
                command = RESTING
            else:
                self.arming = None
                if command.armed is not self._resting.rotors_turn:
                    self._resting.turn(command.armed)
                self._link.send(command, now)
        self.sent = command
        return command

    def grip(self, asked: Grip, now: Time) -> None:
        """Ask for the payload's servo where that makes a difference; a vehicle that refuses fails
        the behavior."""
        activity = self._activity
        activity.grip = None
        try:
            if self._payload.wants(asked.is_open, now, activity.state.at):
                self._link.grip(asked.is_open, now)
        except Refused as refusal:
            activity.fail(str(refusal))

    def _armed(self, command: Command, now: Time) -> bool:
        """Return whether the vehicle follows commands now. One that refuses stays on the ground,
        and its behavior has refused to start."""
        self.arming = None
        try:
            if self._link.arm(command, now):
                return True
        except Refused as refusal:
            activity, reason = self._activity, str(refusal)
            self._events.tell("arming_refused", self._name, activity.state.at, reason=reason)
            activity.refuse(reason)
            return False
        self.arming = command
        return False
