"""Who steers one autopilot, and what it is asked for: to rest, to get ready, to follow, to land, to
stop its rotors.

It obeys while it is armed and in the mode in which it follows. What it does of its own accord, or a
person with a transmitter makes it do, is `taken`; then nothing is sent until somebody asks for it
back. A vehicle that somebody else armed is never disarmed here.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum

from kybflow.core.errors import Refused
from kybflow.core.signals import NS, Command, CommandKind, Time
from kybflow.drivers.mavlink.control.arming import LEAD, Arming, Disarming, MotorStop, PreflightMode
from kybflow.drivers.mavlink.control.lift_off import LiftOff, raised
from kybflow.drivers.mavlink.control.modes import Modes
from kybflow.drivers.mavlink.control.override import ControlRecovery, OverrideDetector
from kybflow.drivers.mavlink.control.requests import CommandRequests
from kybflow.drivers.mavlink.control.setpoints import SetpointStream
from kybflow.drivers.mavlink.firmware import FirmwareProfile
from kybflow.drivers.mavlink.telemetry.received_status import LandedState, ReceivedStatus
from kybflow.parts import Override

STUBBORN: Time = 3 * NS
"""How long it may take to be in its land mode; and what armed it within this is still ours."""
ALIVE = 0.3
"""Seconds without a word that are nothing out of the way."""
WELL: Time = NS
"""How long a link must have been well before a vehicle is taken back unasked."""
RISES = frozenset({CommandKind.POSITION, CommandKind.ACCELERATION})
"""Commands that are raised until it has lifted; the others lift it themselves."""


class OffboardGoal(Enum):
    """What it is asked for. NOTHING: it has not been asked for anything yet."""

    NOTHING = "nothing"
    REST = "rest"
    READY = "ready"
    FOLLOW = "follow"
    LAND = "land"
    STOP = "stop"


class OffboardControl:
    """arming_time: seconds that arming may take. rate: set-points a second. resumes: whether it is
    taken back unasked from its own failsafe, once the link is well. hold: what makes it hold still
    where it is, None where that is not known."""

    def __init__(
        self, profile: FirmwareProfile, status: ReceivedStatus, requests: CommandRequests,
        arming_time: float, rate: float, resumes: bool, hold: Callable[[], Command | None],
    ) -> None:  # fmt: skip
        self.taken: Override | None = None
        self.goal = OffboardGoal.NOTHING
        self.modes = Modes(profile, status, requests)
        self.stream = SetpointStream(rate)
        self.override = OverrideDetector(status, self.modes)
        self._profile, self._status, self._requests = profile, status, requests
        self._arming_time, self._resumes, self._hold = arming_time, resumes, hold
        self._arming: Arming | None = None
        self._disarming = Disarming(status, requests, self.modes)
        self._motor_stop = MotorStop(status, requests)
        first = self.stream if profile.streams_first else None
        self._preflight_mode = PreflightMode(self.modes, first, hold, self._step_mode)
        self._since: Time = 0
        self._left_for = ""  # the mode in which it was asked to land
        self._lift_off = LiftOff(hold)
        self._recovery = ControlRecovery(self.modes, self.stream, hold, self._step_mode)

    def arm(self, command: Command, now: Time) -> bool:
        """Whether it follows. Raises Refused; then it is disarmed where it is armed."""
        if self._status.armed and (self.goal is OffboardGoal.NOTHING or self.taken is not None):
            reason = "it is armed" if self.taken is None else self.taken.reason
            raise Refused(f"somebody else has it: {reason}")
        if self.goal is not OffboardGoal.READY or self._arming is None:
            self._release(OffboardGoal.READY, now)
            self._arming = Arming(
                self._profile, self._status, self._requests, self.modes, self._arming_time, now
            )
        if self._status.armed and self.modes.has_left:
            self._mind(now)
            if self.taken is not None:
                raise Refused(self.taken.reason)
            return False
        if self._profile.streams_first:
            self.stream.feed(self._raised(command, now), now)
        try:
            rises = command.kind in RISES
            obeys = self._arming.step(self.stream, self._lift_off.height, rises, now)
        except Refused:
            self.rest(now)
            raise
        if obeys:
            self._release(OffboardGoal.FOLLOW, now)
            if self._profile.climbs:
                self._lift_off.begin(now)
            self.send(command, now)
        return obeys

    def send(self, command: Command, now: Time) -> None:
        """The newest command. One that is not armed lets it rest."""
        if self.taken is not None or self.goal is OffboardGoal.STOP:
            return
        if not command.armed:
            if self.goal not in (OffboardGoal.REST, OffboardGoal.NOTHING):
                self.rest(now)
            return
        if self.goal is not OffboardGoal.FOLLOW:
            self._release(OffboardGoal.FOLLOW, now)
            self.modes.want("offboard")
        if not (self._lift_off.keeps_back(command, now) or self.override.is_in_doubt):
            self.stream.feed(command, now)

    def prepare(self, now: Time) -> str:
        """Put it, disarmed, into the mode in which it follows; why it is not in it, empty when it
        is. Called once a tick."""
        if self._status.armed or self.goal not in (OffboardGoal.NOTHING, OffboardGoal.REST):
            return "" if self.goal is OffboardGoal.FOLLOW else "it is armed"
        return self._preflight_mode.step(now)

    def rest(self, now: Time) -> None:
        """Disarm it."""
        self._release(OffboardGoal.REST, now)
        self.stream.stop()
        self.modes.want(None)
        self._disarming = Disarming(self._status, self._requests, self.modes)

    def cut(self, now: Time) -> None:
        """Stop its rotors, whoever has it."""
        self._release(OffboardGoal.STOP, now)
        self.stream.stop()
        self.modes.want(None)
        self._motor_stop = MotorStop(self._status, self._requests)

    def land(self, now: Time) -> bool:
        """Land by its own mode; whether it rests. Raises Refused."""
        if self.taken is not None and not self.taken.lands:
            raise Refused(f"somebody else has it: {self.taken.reason}")
        if self.goal is not OffboardGoal.LAND or self.taken is not None:
            self._release(OffboardGoal.LAND, now)
            self._left_for = self.modes.reported
            self.modes.want("land")
        if not self._status.armed:
            return True
        if self.modes.step(now):
            self.stream.stop()
        elif self.modes.has_left:
            self._mind(now)
            if self.taken is not None:
                raise Refused(self.taken.reason)
        elif self.modes.is_manual and self.modes.reported != self._left_for:
            taken = Override(f"a pilot took over: {self.modes.reported}")
            self._take(taken)
            raise Refused(taken.reason)
        elif now - self._since > STUBBORN:
            raise Refused(self.modes.trouble)
        return False

    def reclaim(self, now: Time) -> None:
        """Ask for it back, to hold still until it is commanded again."""
        if self.taken is None or self._recovery.is_under_way:
            return
        if not self._status.armed:
            self.rest(now)
            return
        trouble = self._recovery.begin(now)
        refused = "" if self._recovery.is_unasked else trouble
        self.taken = self.taken._replace(refused=refused)

    @property
    def is_disarming(self) -> bool:
        """Whether it is to be disarmed, and that has not been tried for long."""
        return self.goal is OffboardGoal.REST and self.taken is None and self._disarming.insists

    def look(self, age: float, now: Time) -> None:
        """React to what the autopilot does, once a tick after its messages were taken in. age:
        seconds since its last message."""
        if not self._status.armed:
            self._lift_off.stand(now)
        if self.goal is OffboardGoal.STOP:
            if self._motor_stop.step(now):
                self.rest(now)
        elif self.taken is not None:
            self._look_after(self.taken, age, now)
        elif self.goal is OffboardGoal.REST:
            self._let_rest(now)
        elif self.goal is OffboardGoal.FOLLOW:
            self._mind(now)

    def _raised(self, command: Command, now: Time) -> Command:
        """What it is sent while it arms: armed, what lifts it."""
        if not self._status.armed:
            return command
        return raised(command, self._profile.takeoff_height, self._lift_off.armed_for(now))

    def _step_mode(self, now: Time) -> bool:
        """Whether it is in the mode in which it follows; asked for where set-points flow."""
        leads = not self._profile.streams_first or self.stream.flows(now) >= LEAD
        return leads and self.modes.step(now)

    def _release(self, goal: OffboardGoal, now: Time) -> None:
        self.goal, self._since, self.taken = goal, now, None
        self._recovery.forget()
        self._lift_off.end()
        self.override.forget()
        self._disarming.drop()
        if self._arming is not None:
            self._arming.drop()
            self._arming = None

    def _let_rest(self, now: Time) -> None:
        ours = self._disarming.is_under_way or now - self._since < STUBBORN
        if self._status.armed and not ours:
            self._take(Override(f"somebody armed it: {self.modes.reported}"))
        else:
            self._disarming.step(now)

    def _mind(self, now: Time) -> None:
        """While it is to follow or to land: does it?"""
        found = self.override.found(now)
        if found is not None:
            self._take(Override(found.reason, found.by_itself and not self._resumes))
            if found.by_itself and self._resumes:
                self._recovery.expect()
        elif self.goal is OffboardGoal.FOLLOW and not self.override.is_in_doubt:
            self._step_mode(now)

    def _take(self, taken: Override) -> None:
        self.taken = taken
        self._recovery.forget()
        self.override.forget()
        self.stream.stop()
        self.modes.want(None)

    def _look_after(self, taken: Override, age: float, now: Time) -> None:
        """While somebody else has it. One that was to be taken back unasked is not when it is down,
        it would take off again, nor when a person may have it by now."""
        silence = self.override.silence
        is_well = age < ALIVE and (silence is None or now - silence.ended > WELL)
        back = self._recovery
        is_down = self._status.landed is LandedState.GROUND or self._lift_off.is_low
        if back.is_unasked and (is_down or back.is_elsewhere):
            back.end()
        if back.is_unasked and is_well:
            self.reclaim(now)
        if back.is_under_way:
            self._ask_back(taken, now)

    def _ask_back(self, taken: Override, now: Time) -> None:
        """It is to come back: does it, is it down, or was it asked for long enough?"""
        refused = self._recovery.timed_out(now)
        if refused or not self._status.armed:
            self.taken = taken._replace(refused=refused)
            self._recovery.end()
        elif self._recovery.step(now):
            self._release(OffboardGoal.FOLLOW, now)
