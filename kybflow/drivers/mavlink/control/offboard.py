"""Offboard control of one autopilot: disarming, arming, following setpoints, landing, and stopping
the rotors.

The autopilot follows setpoints while it is armed and in the mode for that. If a pilot or its own
failsafe takes it out of that mode, `override` holds the reason, and no setpoints are sent until
control is requested again. A vehicle that a person or another program armed is never disarmed here,
except by `cut`.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum

from kybflow.core.errors import Refused
from kybflow.core.geometry import LEVEL, ZERO
from kybflow.core.signals import NS, Command, CommandKind, Time
from kybflow.drivers.mavlink.control.arming import (
    LEAD_S,
    Arming,
    Disarming,
    MotorStop,
    PreflightMode,
)
from kybflow.drivers.mavlink.control.override import ControlRecovery, OverrideDetector
from kybflow.drivers.mavlink.control.requests import CommandRequests, Modes
from kybflow.drivers.mavlink.control.setpoints import LiftOff, SetpointStream, raised
from kybflow.drivers.mavlink.firmware import FirmwareProfile
from kybflow.drivers.mavlink.params import THRUSTS
from kybflow.drivers.mavlink.telemetry.received_status import LandedState, ReceivedStatus, Silence
from kybflow.parts import Override

MODE_TIMEOUT: Time = 3 * NS
"""How long the change to the land mode may take. If the vehicle gets armed within this time after a
disarming, this is attributed to our earlier request."""
MOST_GAP = 0.3
"""The longest normal interval between messages, seconds."""
STABLE_LINK_NS: Time = NS
"""How long a link must have been good before control is taken back without a request."""
LIFTED_BY_SETPOINT = frozenset({CommandKind.POSITION, CommandKind.ACCELERATION})
"""Kinds of commands that are raised until the vehicle has lifted off; the others lift it as they
are."""
IDLE = Command(LEVEL, 0.0, ZERO, None)
"""The command of a landed vehicle that avoids its land mode, until it is disarmed."""


class OffboardGoal(Enum):
    """What is requested from the autopilot: nothing yet, disarming, arming, following setpoints,
    landing in its own mode, or stopping its rotors unconditionally."""

    NONE = "none"
    DISARM = "disarm"
    ARM = "arm"
    FOLLOW = "follow"
    LAND = "land"
    KILL = "kill"


class OffboardControl:
    """Offboard control of one vehicle.

    arming_time: seconds that arming may take.
    stream: the setpoints to send; the link sends those that are due.
    resumes: whether control is taken back without a request after the vehicle's own failsafe, once
    the link is good.
    hold: returns the command that holds the vehicle still at its position, None while that is
    unknown.
    knows_position: returns whether the autopilot has a source of positions.
    override: why the vehicle doesn't follow, None while it does.
    """

    def __init__(
        self, profile: FirmwareProfile, status: ReceivedStatus, requests: CommandRequests,
        stream: SetpointStream, arming_time: float, resumes: bool,
        hold: Callable[[], Command | None], knows_position: Callable[[Time], bool],
    ) -> None:  # fmt: skip
        self.override: Override | None = None
        self.goal = OffboardGoal.NONE
        self.modes = Modes(profile, status, requests)
        self._stream = stream
        self.detector = OverrideDetector(status, self.modes)
        self._profile, self._status, self._requests = profile, status, requests
        self._arming_time, self._resumes = arming_time, resumes
        self._knows_position = knows_position
        self._arming: Arming | None = None
        self._disarming = Disarming(status, requests, self.modes, avoids_mode=False)
        self._motor_stop = MotorStop(status, requests)
        first = self._stream if profile.streams_first else None
        self._preflight_mode = PreflightMode(self.modes, first, hold, self._step_mode)
        self._since: Time = 0
        self._mode_before_land = ""
        self._lift_off = LiftOff(hold)
        self._recovery = ControlRecovery(self.modes, self._stream, hold, self._step_mode)

    def arm(self, command: Command, now: Time) -> bool:
        """Arm the vehicle; return whether it follows setpoints. Called once a tick until it does.
        Raises Refused, after requesting to disarm if arming failed."""
        if self._status.armed and (self.goal is OffboardGoal.NONE or self.override is not None):
            reason = "it is armed" if self.override is None else self.override.reason
            raise Refused(f"a pilot or another program controls it: {reason}")
        if self.goal is not OffboardGoal.ARM or self._arming is None:
            self._begin(OffboardGoal.ARM, now)
            self._arming = Arming(
                self._profile, self._status, self._requests, self.modes, self._arming_time, now
            )
        if self._status.armed and self.modes.has_left:
            self._watch_control(now)
            if self.override is not None:
                raise Refused(self.override.reason)
            return False
        if self._profile.streams_first:
            sent = command
            if self._status.armed:
                seconds = self._lift_off.armed_for(now)
                sent = raised(command, self._profile.takeoff_height, seconds)
            self._stream.feed(sent, now)
        try:
            rises = command.kind in LIFTED_BY_SETPOINT
            follows = self._arming.step(self._stream, self._lift_off.height, rises, now)
        except Refused:
            self.disarm(now)
            raise
        if follows:
            self._begin(OffboardGoal.FOLLOW, now)
            if self._profile.climbs:
                self._lift_off.begin(now)
            self.send(command, now)
        return follows

    def send(self, command: Command, now: Time) -> None:
        """Follow this command from now on. A command that is not `armed` disarms the vehicle."""
        if self.override is not None or self.goal is OffboardGoal.KILL:
            return
        if not command.armed:
            if self.goal not in (OffboardGoal.DISARM, OffboardGoal.NONE):
                self.disarm(now)
            return
        if self.goal is not OffboardGoal.FOLLOW:
            self._begin(OffboardGoal.FOLLOW, now)
            self.modes.want("offboard")
        if not (self._lift_off.holds_back(command, now) or self.detector.is_in_doubt):
            self._stream.feed(command, now)

    def prepare(self, now: Time) -> str:
        """Put the disarmed vehicle into the mode that follows setpoints. Return why that mode is
        not in force; empty if it is. Called once a tick."""
        if self._status.armed or self.goal not in (OffboardGoal.NONE, OffboardGoal.DISARM):
            return "" if self.goal is OffboardGoal.FOLLOW else "it is armed"
        return self._preflight_mode.step(now)

    def disarm(self, now: Time) -> None:
        kind = self._stream.kind if self.goal is OffboardGoal.FOLLOW else None
        is_misled = kind in THRUSTS and not self._knows_position(now)
        by_acceleration = kind is CommandKind.ACCELERATION and self._profile.needs_descent
        avoids_mode = is_misled or (by_acceleration and self._lift_off.is_low)
        self._begin(OffboardGoal.DISARM, now)
        self._stream.stop()
        self.modes.want(None)
        self._disarming = Disarming(self._status, self._requests, self.modes, avoids_mode)

    def cut(self, now: Time) -> None:
        """Stop the rotors, even if a pilot or another program controls the vehicle."""
        self._begin(OffboardGoal.KILL, now)
        self._stream.stop()
        self.modes.want(None)
        self._motor_stop = MotorStop(self._status, self._requests)

    def land(self, now: Time) -> bool:
        """Land in the autopilot's own land mode; return whether the vehicle is disarmed. Called
        once a tick. Raises Refused."""
        if self.override is not None and not self.override.lands:
            raise Refused(f"a pilot or another program controls it: {self.override.reason}")
        if self.goal is not OffboardGoal.LAND or self.override is not None:
            self._begin(OffboardGoal.LAND, now)
            self._mode_before_land = self.modes.reported
            self.modes.want("land")
        if not self._status.armed:
            return True
        if self.modes.step(now):
            self._stream.stop()
        elif self.modes.has_left:
            self._watch_control(now)
            if self.override is not None:
                raise Refused(self.override.reason)
        elif self.modes.is_manual and self.modes.reported != self._mode_before_land:
            taken = Override(f"a pilot took over: {self.modes.reported}")
            self._lose_control(taken)
            raise Refused(taken.reason)
        elif now - self._since > MODE_TIMEOUT:
            raise Refused(self.modes.trouble)
        return False

    def reclaim(self, now: Time) -> None:
        """Request control of the vehicle. It then holds still until it is commanded again."""
        if self.override is None or self._recovery.is_under_way:
            return
        if not self._status.armed:
            self.disarm(now)
            return
        trouble = self._recovery.begin(now)
        refused = "" if self._recovery.is_unasked else trouble
        self.override = self.override._replace(refused=refused)

    @property
    def is_disarming(self) -> bool:
        """Whether disarming is under way and not yet overdue."""
        return (
            self.goal is OffboardGoal.DISARM
            and self.override is None
            and self._disarming.is_retrying
        )

    def update(self, age: float, silence: Silence | None, now: Time) -> None:
        """React to the autopilot's state, once a tick after its messages were handled. age: seconds
        since its last message. silence: the most recent interval without one."""
        self.detector.silence = silence
        if not self._status.armed:
            self._lift_off.stand(now)
        if self.goal is OffboardGoal.KILL:
            if self._motor_stop.step(now):
                self.disarm(now)
        elif self.override is not None:
            self._wait_or_recover(self.override, age, now)
        elif self.goal is OffboardGoal.DISARM:
            ours = self._disarming.is_under_way or now - self._since < MODE_TIMEOUT
            if self._status.armed and not ours:
                self._lose_control(Override(f"somebody armed it: {self.modes.reported}"))
            else:
                self._disarming.step(now)
                if self._disarming.idles(now):
                    self._stream.feed(IDLE, now)
        elif self.goal is OffboardGoal.FOLLOW:
            self._watch_control(now)

    def _step_mode(self, now: Time) -> bool:
        """Request the mode that follows setpoints; if the firmware requires it, only after
        setpoints have been sent for `LEAD_S`. Return whether the mode is in force."""
        leads = not self._profile.streams_first or self._stream.flows(now) >= LEAD_S
        return leads and self.modes.step(now)

    def _begin(self, goal: OffboardGoal, now: Time) -> None:
        self.goal, self._since, self.override = goal, now, None
        self._recovery.forget()
        self._lift_off.end()
        self.detector.forget()
        self._disarming.drop()
        if self._arming is not None:
            self._arming.drop()
            self._arming = None

    def _watch_control(self, now: Time) -> None:
        """Detect that the vehicle no longer follows setpoints, or no longer lands, as requested."""
        found = self.detector.found(now)
        if found is not None:
            self._lose_control(Override(found.reason, found.by_itself and not self._resumes))
            if found.by_itself and self._resumes:
                self._recovery.expect()
        elif self.goal is OffboardGoal.FOLLOW and not self.detector.is_in_doubt:
            self._step_mode(now)

    def _lose_control(self, override: Override) -> None:
        self.override = override
        self._recovery.forget()
        self.detector.forget()
        self._stream.stop()
        self.modes.want(None)

    def _wait_or_recover(self, override: Override, age: float, now: Time) -> None:
        """While overridden, take control back if that was requested or may happen without a
        request. The latter is ruled out for a vehicle that has landed, which would take off again,
        and for one that a person may be controlling."""
        silence = self.detector.silence
        is_stable = age < MOST_GAP and (silence is None or now - silence.ended > STABLE_LINK_NS)
        back = self._recovery
        is_down = self._status.landed is LandedState.GROUND or self._lift_off.is_low
        if back.is_unasked and (is_down or back.is_elsewhere):
            back.end()
        if back.is_unasked and is_stable:
            self.reclaim(now)
        if not back.is_under_way:
            return
        refused = back.timed_out(now)
        if refused or not self._status.armed:
            self.override = override._replace(refused=refused)
            back.end()
        elif back.step(now):
            self._begin(OffboardGoal.FOLLOW, now)
