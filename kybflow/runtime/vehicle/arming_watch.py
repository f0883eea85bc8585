"""Compares the vehicle's report of being armed with whether its rotors should turn.

In the air, a vehicle that reports itself disarmed while it falls has disarmed in flight. It counts
as falling if a fresh estimate places it above everything that could carry it and shows it sinking
faster than any landing. Its rotors are then cut, and it doesn't count as landed. A vehicle that
falls from a low height is on the ground before it reports itself disarmed, so a fall is remembered
for `LATE` after its end.

On the ground, the driver requests a vehicle that has landed to disarm. If the vehicle is still
armed after `SLOW`, `stays_armed` is emitted. After `FORCED` the vehicle is disarmed by force,
provided a fresh estimate near the ground has stood still for `STOOD` and the vehicle doesn't report
that it flies. After `GIVEN_UP` the run no longer waits for the vehicle and has failed.
"""

from __future__ import annotations

from kybflow.core.errors import Refused
from kybflow.core.geometry import distance
from kybflow.core.signals import NS, Alarm, Estimate, Reaction, Tick, Time
from kybflow.dsl.plan import VehiclePlan
from kybflow.parts import GROUND
from kybflow.parts.events import ControlLost, StaysArmed
from kybflow.runtime.events import Events
from kybflow.runtime.safety.failsafe import RaisedAlarm
from kybflow.runtime.scores import VehicleScore
from kybflow.runtime.vehicle.behavior_runner import UNCLEAR, BehaviorRunner
from kybflow.runtime.vehicle.link import ALIVE, LinkOut
from kybflow.runtime.vehicle.output import CommandOutput
from kybflow.runtime.vehicle.reactions import Reactions
from kybflow.world.ground import FRESH, height_in_the_air

FALLING = 1.2
"""Sink rate of a falling vehicle, m/s. No landing sinks as fast."""
LATE: Time = NS // 2
"""How late a vehicle may report that its rotors have stopped."""
SLOW: Time = 5 * NS
FORCED: Time = 10 * NS
GIVEN_UP: Time = 30 * NS
STOOD: Time = 3 * NS
STILL = 0.03
"""Metres by which the estimate may move while the vehicle stands still."""


class ArmingWatch:
    """Compares reported and expected arming once a tick. gave_up: whether the vehicle stayed armed
    on the ground for so long that the run no longer waits for it."""

    def __init__(
        self,
        plan: VehiclePlan,
        link: LinkOut,
        runner: BehaviorRunner,
        reactions: Reactions,
        output: CommandOutput,
        events: Events,
        score: VehicleScore,
    ) -> None:
        self.gave_up = False
        self._name, self._at = plan.name, plan.driver.at
        self._link, self._runner, self._reactions = link, runner, reactions
        self._output, self._events, self._score = output, events, score
        self._since: Time | None = None
        self._fell: tuple[Time, float] | None = None
        self._stood: Time | None = None
        self._stands: Estimate | None = None
        self._reported = self._forced = False

    def update(self, tick: Tick, armed: bool) -> bool:
        """Compare in this tick; return whether the vehicle was found to have disarmed in the air.
        armed: whether the vehicle reports itself armed."""
        if armed is self._output.sent.armed:
            self._since = self._stands = None
            known = tick.estimate
            if armed and known is not None and known.velocity[2] < -FALLING:
                self._note_fall(tick)
            return False
        if not armed:
            return self._runner.off_ground and self._has_fallen(tick)
        is_quiet = tick.link_age > ALIVE or self._link.override is not None
        if self._runner.flight is GROUND and self._output.arming is None and not is_quiet:
            self._watch_landed(tick)
        return False

    def may_fall(self, tick: Tick) -> bool:
        """Return whether a vehicle whose rotors stopped just now may still be in the air, although
        its estimate doesn't show a fall yet."""
        if self._since is None:
            self._since = tick.now
        return tick.now - self._since < UNCLEAR and self._above(tick.estimate) > 0.0

    def _note_fall(self, tick: Tick) -> None:
        """Record the height of a vehicle that sinks faster than any landing."""
        above = self._above(tick.estimate)
        if above > 0.0:
            self._fell = tick.now, above

    def _has_fallen(self, tick: Tick) -> bool:
        """Return whether the vehicle, whose rotors rest, falls or fell within the last `LATE`, and
        the reaction to that changed anything."""
        known = tick.estimate
        if known is not None and known.velocity[2] < -FALLING:
            self._note_fall(tick)
        if self._fell is None or tick.now - self._fell[0] > LATE:
            return False
        above, self._fell = self._fell[1], None
        reason = f"it disarmed in the air: its estimate has it {above:.2f} m above the ground"
        self._events.emit(ControlLost(reason=reason), self._name, self._at)
        lost = Alarm("control_lost", Reaction.CUT, reason, is_failure=True)
        return self._reactions.react(RaisedAlarm(lost, self._at), tick)

    def _watch_landed(self, tick: Tick) -> None:
        """Watch a vehicle that has landed and is still armed: report, disarm by force, give up."""
        if self._since is None:
            self._since, self._reported, self._forced = tick.now, False, False
        waited = tick.now - self._since
        stands = self._has_stood(tick.estimate, tick.now)
        if waited >= SLOW and not self._reported:
            self._reported = True
            self._emit("it has landed, is asked to disarm, and stays armed")
        if waited >= FORCED and not self._forced and stands:
            self._forced = True
            self._force(tick.now)
        if waited >= GIVEN_UP and not self.gave_up:
            self.gave_up = True
            reason = f"it has landed, and is still armed after {GIVEN_UP // NS} s: disarm it"
            self._emit(reason)
            self._score.failure(reason)

    def _force(self, now: Time) -> None:
        try:
            self._link.disarm_by_force(now)
        except Refused as refusal:
            self._emit(f"it can't be disarmed by force: {refusal}")
        else:
            self._emit("it stands still on the ground: disarmed by force")

    def _has_stood(self, known: Estimate | None, now: Time) -> bool:
        """Return whether the estimate has stood still on the ground for `STOOD`."""
        if known is None or known.age > FRESH or self._above(known) > 0.0:
            self._stands = None
            return False
        before = self._stands
        if before is None or distance(known.position, before.position) > STILL:
            self._stands, self._stood = known, now
        return self._stood is not None and now - self._stood >= STOOD

    def _above(self, known: Estimate | None) -> float:
        """Return the vehicle's least height above the ground (m), zero if it may stand on it."""
        if known is None:
            return 0.0
        return height_in_the_air(self._runner.entry().context, known, ())

    def _emit(self, reason: str) -> None:
        self._events.emit(StaysArmed(reason=reason), self._name, self._at)
