"""Sends a vehicle's commands, after arming it, and operates its payload's servo."""

from __future__ import annotations

from kybflow.core.errors import Refused
from kybflow.core.geometry import LEVEL, ZERO
from kybflow.core.signals import Command, Grip, Time
from kybflow.dsl.plan import VehiclePlan
from kybflow.parts.events import ArmingRefused
from kybflow.runtime.events import Events
from kybflow.runtime.monitoring.resting_bias import RestingBias
from kybflow.runtime.vehicle.activity import Activity
from kybflow.runtime.vehicle.link import LinkOut
from kybflow.runtime.vehicle.payload import PayloadTracker

RESTING = Command(LEVEL, 0.0, ZERO, None, False)
"""The command of a vehicle on the ground: rotors at rest."""
HANDED_OVER = Command(LEVEL, 0.0, ZERO, None)
"""What is recorded while a land mode, its watchdog or a pilot flies the vehicle: armed, no thrust
requested."""


class CommandOutput:
    """Arms the vehicle and sends its commands.

    sent: the last command. arming: the command that waits for arming, None without one; the
    behavior's time stands still meanwhile.
    """

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
        """Send the command of a tick over the link; return what was sent. The first command with
        thrust arms the vehicle, which may take seconds; meanwhile, and if the vehicle refuses, its
        rotors rest."""
        activity = self._activity
        if activity.behavior.lets_go:
            command = HANDED_OVER
        elif activity.land_mode is None:
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
        """Open or close the payload's servo if necessary. A refusal fails the behavior."""
        activity = self._activity
        activity.grip = None
        try:
            if self._payload.wants(asked.is_open, now, activity.state.at):
                self._link.grip(asked.is_open, now)
        except Refused as refusal:
            activity.fail(str(refusal))

    def _armed(self, command: Command, now: Time) -> bool:
        """Request arming; return whether the vehicle follows commands now. A vehicle that refuses
        stays on the ground, and its behavior counts as refused."""
        self.arming = None
        try:
            if self._link.arm(command, now):
                return True
        except Refused as refusal:
            activity, reason = self._activity, str(refusal)
            self._events.emit(ArmingRefused(reason=reason), self._name, activity.state.at)
            activity.refuse(reason)
            return False
        self.arming = command
        return False
