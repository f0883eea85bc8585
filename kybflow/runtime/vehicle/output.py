"""Sends a vehicle's commands, after arming it, and operates its payload's servo."""

from __future__ import annotations

from kybflow.core.errors import Refused
from kybflow.core.signals import Command, Time
from kybflow.dsl.plan import VehiclePlan
from kybflow.parts.events import ArmingRefused
from kybflow.runtime.events import Events
from kybflow.runtime.vehicle.behavior_runner import BehaviorRunner
from kybflow.runtime.vehicle.control import HANDED_OVER, RESTING
from kybflow.runtime.vehicle.knowledge import PayloadTracker, RestingBias
from kybflow.runtime.vehicle.link import LinkOut


class CommandOutput:
    """Arms the vehicle and sends its commands.

    sent: the last command.
    arming: the command that waits until the vehicle is armed, or None. While it waits, the
    behavior's timers stand still.
    """

    def __init__(
        self,
        plan: VehiclePlan,
        link: LinkOut,
        runner: BehaviorRunner,
        payload: PayloadTracker,
        resting: RestingBias,
        events: Events,
    ) -> None:
        self.sent = RESTING
        self.arming: Command | None = None
        self._name, self._link, self._runner, self._events = plan.name, link, runner, events
        self._payload, self._resting = payload, resting

    def deliver(self, command: Command, now: Time) -> Command:
        """Send the command of a tick over the link; return the command that was sent. The first
        armed command arms the vehicle, which may take seconds; until then, and if the vehicle
        refuses, nothing is sent and `RESTING` is returned."""
        runner = self._runner
        if runner.behavior.lets_go:
            command = HANDED_OVER
        elif runner.land_mode is None:
            if command.armed and not self.sent.armed and not self._armed(command, now):
                command = RESTING
            else:
                self.arming = None
                if command.armed is not self._resting.rotors_turn:
                    self._resting.turn(command.armed)
                self._link.send(command, now)
        self.sent = command
        return command

    def hand_over(self) -> Command:
        """Send nothing, because a pilot flies the vehicle; return the command to record."""
        self.sent = HANDED_OVER
        return HANDED_OVER

    def cancel_arming(self) -> None:
        """Stop arming for the command of a state that was left."""
        self.arming = None

    def grip(self, now: Time) -> None:
        """Open or close the payload's servo if the behavior requests it and it is necessary. If
        the vehicle refuses, the behavior fails."""
        runner = self._runner
        asked = runner.take_grip()
        try:
            if asked is not None and self._payload.wants(asked.is_open, now, runner.state.at):
                self._link.grip(asked.is_open, now)
        except Refused as refusal:
            runner.fail(str(refusal))

    def _armed(self, command: Command, now: Time) -> bool:
        """Request arming; return whether the vehicle is armed and follows commands. If it refuses,
        it stays on the ground and the behavior counts as refused."""
        self.arming = None
        try:
            if self._link.arm(command, now):
                return True
        except Refused as refusal:
            runner, reason = self._runner, str(refusal)
            self._events.emit(ArmingRefused(reason=reason), self._name, runner.state.at)
            runner.refuse(reason)
            return False
        self.arming = command
        return False
