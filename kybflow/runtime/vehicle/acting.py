"""From what a vehicle knows to what it is sent, whatever fails on the way.

supervisors ─► wishes ─► transition? ─► behavior ─► setpoint ─► processors ─► tracker ─► command
"""

from __future__ import annotations

from typing import Any

from kybflow.core.errors import PartFailed, Refused
from kybflow.core.geometry import LEVEL, ZERO
from kybflow.core.signals import Alarm, Command, Grip, Reaction, Setpoint, SetpointKind, Tick, Time
from kybflow.parts import AIR, GROUND
from kybflow.runtime.finite import checked_command, checked_setpoint
from kybflow.runtime.safety.failsafe import STATES, Heard
from kybflow.runtime.safety.land_mode import HANDED_OVER, LandMode
from kybflow.runtime.vehicle.chain import Chain
from kybflow.runtime.vehicle.commanding import Commanding
from kybflow.runtime.vehicle.senses import Senses
from kybflow.world.vehicle_context import VehicleContext

RESTING = Command(LEVEL, 0.0, ZERO, None, False)
"""What a vehicle on the ground is sent: rotors at rest."""
_ESCALATIONS = 5
"""`go_home`, `land`, `land_blind`, `fault`, all in one tick at worst, and one to steer at last."""
_LEAST_HOVER, _MOST_HOVER = 0.5, 2.0
"""Parts of the airframe's weight between which a tracker's belief of the hover thrust counts."""


class Acting(Commanding):
    """The part of a vehicle that acts.

    `followed` is the setpoint that the tracker followed last, None while there is none.
    """

    context: VehicleContext
    senses: Senses
    _params: dict[str, Any]
    _chain: Chain

    def __init__(self) -> None:
        super().__init__()
        self.followed: Setpoint | None = None
        self._sent = RESTING
        self._cut: Time | None = None

    @property
    def airborne(self) -> bool:
        """Whether its rotors turn and it is not on the ground."""
        return self.activity.airborne and self._sent.armed

    def react(self, heard: Heard, tick: Tick) -> bool:
        """Let the failsafe decide about an alarm; whether the vehicle now does something else."""
        activity = self.activity
        airborne = self.airborne
        reaction = self.failsafe.decide(heard, tick, airborne, activity.machine.state)
        if reaction is None:
            return False
        if reaction is Reaction.BRAKE:
            activity.freeze("brake", self.entry)
            return True
        if not airborne:
            activity.flight = GROUND  # rotors at rest: it has not left the ground
        elif reaction is Reaction.CUT:
            activity.flight, self._cut = GROUND, tick.now
            self.senses.asking.cut(tick.now)
        activity.go(STATES[reaction] if airborne else "fault", self.entry)
        if airborne and self.senses.lands_itself(reaction):
            self._hand_over(tick.now)
        return True

    def _decided(self, tick: Tick) -> tuple[Command, Setpoint | None]:
        """(the command of this tick, the setpoint before processing), whatever fails."""
        try:
            tick = self._decide(tick)
            return self._steer(tick)
        except Exception as error:  # a part may raise anything; it fails this vehicle alone
            failure = error
        return self._rescued(failure, tick)

    def _rescued(self, failure: Exception, tick: Tick) -> tuple[Command, Setpoint | None]:
        """The same after a failure."""
        for _ in range(_ESCALATIONS + len(self.plan.processors)):
            try:
                self._escalate(failure, tick)
                tick = self._settled(tick)
                return self._steer(tick)
            except Exception as error:  # see _decided
                failure = error
        return RESTING, None

    def _decide(self, tick: Tick) -> Tick:
        """Supervisors are heard first, then who asks, then the mission's own arrows."""
        activity = self.activity
        heard = self.failsafe.check(tick, activity.airborne)
        if heard is not None:
            self.react(heard, tick)
        if activity.changed:
            tick = self._settled(tick)
        if self._wishes.waiting:
            self._answer()
        if activity.hold is not None:
            self._go_on_holding(activity.hold, tick.now)
        elif not activity.changed:
            activity.step(tick, self.failsafe.latched is not None, self.entry)
        return self._settled(tick) if activity.changed else tick

    def _settled(self, tick: Tick) -> Tick:
        """Make the chain fit the state that was entered; the tick as the new behavior sees it."""
        activity = self.activity
        if not activity.changed:
            return tick
        activity.changed = False
        if activity.leg.start is GROUND and activity.leg.end is AIR:
            self._chain = Chain(self.plan, self.context, self._params)
        self._select()
        self.senses.subscribe(activity.state.behavior.cls.needs)
        self.senses.estimation.prefer(activity.state.estimators)
        return tick._replace(elapsed=0.0)

    def _select(self) -> None:
        self._chain.select(self.activity.stays_in_air, self._off)

    def _steer(self, tick: Tick) -> tuple[Command, Setpoint | None]:
        """(the command of this tick, the setpoint before processing)."""
        activity = self.activity
        if activity.land_mode is not None:
            return self._handed_over(tick)
        if tick.estimate is None and activity.behavior.needs_estimate:
            self.followed = None
            if not activity.airborne:
                return RESTING, None
            lost = Alarm("estimate_lost", Reaction.LAND_BLIND, "no estimate to fly by")
            if self.react(Heard(lost, activity.state.at), tick):
                return self._steer(self._settled(tick))
        output = activity.update(tick)
        if isinstance(output, Command):
            command = self._armed(checked_command(output))
            self.followed = None
            return command, None
        if output.kind is SetpointKind.IDLE:
            if activity.airborne:
                raise ValueError("the rotors can't rest in the air")
            self.followed = None
            return RESTING, output
        result = self._chain.follow(checked_setpoint(output), tick, self._heed)
        if result is None:
            return self._steer(self._settled(tick))
        self.followed, command = result
        return self._armed(command), output

    def _hand_over(self, now: Time) -> None:
        """Land by the vehicle's own mode, in place of the state that was entered."""
        estimate = self.senses.estimate
        height = 0.0 if estimate is None else estimate.position[2] - self.context.start[2]
        self.activity.land_mode = LandMode(self.senses.land, now, height)
        self._tell("land_mode_started", self.plan.driver.at)

    def _handed_over(self, tick: Tick) -> tuple[Command, Setpoint | None]:
        """The same while it lands by its own mode; once it won't, the state begins anew."""
        self.followed = None
        try:
            landed = self.activity.has_landed(tick.now, tick.estimate)
        except Refused as refusal:
            self._tell("land_mode_refused", self.plan.driver.at, reason=str(refusal))
            self.activity.go(self.activity.machine.state, self.entry)
            return self._steer(self._settled(tick))
        return (RESTING if landed else HANDED_OVER), None

    def _grip(self, asked: Grip, now: Time) -> None:
        """Ask for the payload's servo; a vehicle that refuses fails the behavior."""
        self.activity.grip = None
        try:
            self.senses.grip(asked.is_open, now, self.activity.state.at)
        except Refused as refusal:
            self.activity.fail(str(refusal))

    def _armed(self, command: Command) -> Command:
        """Raises ValueError for rotors at rest in the air."""
        if self.activity.airborne and not command.armed:
            raise ValueError("the rotors can't rest in the air")
        return command

    def _heed(self, label: str, alarm: Alarm, tick: Tick) -> bool:
        return self.react(self.failsafe.tell(label, alarm, tick.now), tick)

    def _escalate(self, error: Exception, tick: Tick) -> None:
        """A part raised: a processor is left out, and the vehicle lands; blind when what a landing
        needs has failed. Rotors rest when even that has failed, or when they rested before."""
        activity, failsafe, chain = self.activity, self.failsafe, self._chain
        part, chain.stage = chain.stage or activity.state.behavior.label, ""
        failure = error if isinstance(error, PartFailed) else PartFailed(part, error)
        reaction = Reaction.LAND
        if not chain.drop(failure.part):
            activity.fail(str(failure))
            if failsafe.latched is Reaction.LAND_BLIND:
                activity.flight = GROUND
            elif failsafe.latched is Reaction.LAND:
                reaction = Reaction.LAND_BLIND
        self.react(failsafe.failure(failure, reaction, activity.state.at), tick)

    def _hover_thrust(self) -> float:
        """The tracker's belief in the air; the airframe's weight where that can't be."""
        weight = self.context.airframe.hover_thrust
        if not self.activity.airborne:
            return weight
        try:
            believed = self._chain.tracker.hover_thrust
        except Exception:  # land_blind must be able to start without a tracker
            return weight
        return believed if _LEAST_HOVER <= believed / weight <= _MOST_HOVER else weight
