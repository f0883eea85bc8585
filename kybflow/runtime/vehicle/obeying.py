"""Whether the vehicle obeys: it is woken before its first armed command, left alone while somebody
else has it, and goes on when it is given back.

A vehicle on the ground that is asked for thrust arms first, which may take seconds; the behavior's
time stands still until it obeys. One that refuses stays on the ground, with its own words, and its
behavior has refused to start. A vehicle that a pilot took is sent nothing and decides nothing;
`operator.resume` asks for it back, and what was frozen goes on from where it is then; one that does
not come is told. One that its own failsafe took is landed.
"""

from __future__ import annotations

from kybflow.core.errors import Refused
from kybflow.core.signals import Alarm, Command, Reaction, Setpoint, Tick, Time
from kybflow.parts import GROUND, Taken
from kybflow.runtime.safety.failsafe import Heard
from kybflow.runtime.vehicle.acting import RESTING, Acting
from kybflow.runtime.vehicle.requests import Wish


class Obeying(Acting):
    """`away`: somebody else has the vehicle."""

    def __init__(self) -> None:
        super().__init__()
        self.away = False
        self._waking: Command | None = None
        self._brought_down: Taken | None = None
        self._lost: Taken | None = None
        self._refused = ""

    def _handed(self, command: Command, now: Time) -> Command:
        """Hand the command of a tick to the link; what it was given."""
        if self.activity.land_mode is not None:
            return command
        if command.armed and not self._sent.armed and not self._woken(command, now):
            return RESTING
        self._waking = None
        self.senses.send(command, now)
        return command

    def _woken(self, command: Command, now: Time) -> bool:
        """Whether the vehicle follows commands now."""
        self._waking = None
        try:
            if self.senses.asking.arm(command, now):
                return True
        except Refused as refusal:
            self._tell("arming_refused", self.activity.state.at, reason=str(refusal))
            self.activity.refuse(str(refusal), self.entry)
            return False
        self._waking = command
        return False

    def _settled(self, tick: Tick) -> Tick:
        if self.activity.changed:
            self._waking = None
        return super()._settled(tick)

    def _steer(self, tick: Tick) -> tuple[Command, Setpoint | None]:
        if self._waking is not None:
            self.activity.wait(tick.dt)
            return self._waking, None
        return super()._steer(tick)

    def _mind_taken(self, tick: Tick) -> None:
        """Note whether somebody else has the vehicle in this tick."""
        taken = self.senses.asking.taken
        if taken is None or not self.activity.airborne:
            self._lost = None
            if self.away:
                self._returned()
        elif taken.lands:
            self._claimed()
            if taken != self._lost:
                self._lost = taken
                self._tell("control_lost", self.plan.driver.at, reason=taken.reason)
            lost = Alarm("control_lost", Reaction.LAND, taken.reason)
            self.react(Heard(lost, self.plan.driver.at), tick)
            self._bring_down(taken, tick.now)
        else:
            self._stand_by(taken, tick)

    def _stand_by(self, taken: Taken, tick: Tick) -> None:
        """Freeze what it was doing, once; answer who asks; see whether it was landed."""
        if not self.away:
            self.away, self.followed = True, None
            self._tell("control_taken", self.plan.driver.at, reason=taken.reason)
            self.failsafe.unbrake()
            self.activity.freeze("pilot", self.entry)
        if taken.refused and taken.refused != self._refused:
            self._tell("control_refused", self.plan.driver.at, reason=taken.refused)
        self._refused = taken.refused
        self.activity.wait(tick.dt)
        self.failsafe.check(tick, airborne=False)  # they go on looking; nobody reacts
        if self._wishes.waiting:
            self._answer()
        if self.senses.asking.armed is False:
            self.away = False
            self._score.failure(taken.reason)
            self.activity.flight = GROUND
            self.activity.go("landed", self.entry)

    def _bring_down(self, taken: Taken, now: Time) -> None:
        """It follows nothing: what comes down by commands comes down by the vehicle's own mode,
        which is asked for once each time that it is taken."""
        activity = self.activity
        comes_down = activity.machine.state in ("auto_land", "land_blind")
        if taken is self._brought_down or not (comes_down and self.senses.can_land):
            return
        self._brought_down = taken
        if activity.land_mode is None:
            self._hand_over(now)

    def _claimed(self) -> None:
        """What was left to somebody else turns out to be the vehicle's own failsafe."""
        if self.away:
            self.away = False
            self.activity.thaw("pilot", self.entry)

    def _returned(self) -> None:
        self.away = False
        self._tell("control_returned", self.plan.driver.at)
        self.activity.thaw("pilot", self.entry)

    @property
    def _is_somebodys(self) -> bool:
        """Whether a person has it, or had it when it came down."""
        taken = self.senses.asking.taken
        return self.away or (taken is not None and not taken.lands)

    def _against(self, wish: Wish) -> str | None:
        if self._is_somebodys:
            return "somebody else has it, until `operator.resume`"
        return super()._against(wish)

    def _resume(self, by: str, at: str) -> None:
        if self._is_somebodys:
            self._refused = ""
            self.senses.asking.reclaim(self.now)
        super()._resume(by, at)
