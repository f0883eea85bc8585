"""Report a vehicle that follows its commands later than its position loop can bear.

Alarm `commands_late` in the air when commands take effect so much later than the driver declares
that `share` of the loop's delay margin (`kybflow show` prints it) is used up. Beyond the margin the
vehicle oscillates ever more. The alarm then lasts for as long as the vehicle flies.

The evidence is the vehicle's motion. About body x and y, the on-board loop obeys the command u with
rotors A, and obeying shows in y, computed from the estimate and the gyroscope
(`kybflow.world.vehicle_context`, divided by P, with H = s / (s + I / P) for the integral):

    u = tilt commanded + D/P H rates commanded,    y = tilt + D/P H w + w' / P,    y = A u

So a torque on the body is in y, but wind isn't, because it moves the vehicle without turning it. u
is delayed to where a punctual vehicle would be by a lag of the declared delay. With both in the
band around 1 / `_BAND_S`, in which loops of this kind oscillate, the excess L is the regression

    L = -<(y - u) u'> / <u'^2>,       as y(t) = u(t - L) = u - L u' + ...,

averaged over `_AVERAGING_S`. With a sinusoid of frequency f it is sin(f L) / f, so that L is found
too small, but never negative, as an oscillating loop lags by less than half a turn. It counts if it
is above the bound for half a second, if u moves by more than noise, and if the delay explains more
than `_EXPLAINED` of the difference, <(y - u) u'>^2 > `_EXPLAINED` <(y - u)^2> <u'^2>: the noise of
measurements and gusts explain less.

L in flights of four airframes, hovering and on an eight, over three seeds, relative to margins of
51 to 58 ms: 0 to 0.3 without delay, at most 0.72 with 30 ms of delay, at least 0.78 with 60 ms and
1.4 with 100 ms, which is noticed after 1.1 s (1.5 s at most).

Without a tracker that commands attitudes in a loop whose margin is known, or without an IMU,
nothing is judged; nor where the link measures round trips, because `link` then watches these. The
margin is that of the gains at the start. The default reaction is `land_blind`, which opens the loop: every
other one is flown by it. Radians, seconds, body frame.
"""

from __future__ import annotations

from typing import NamedTuple

from kybflow.core.geometry import Quat
from kybflow.core.signals import (
    IMU_TIMEOUT,
    NS,
    Alarm,
    CommandKind,
    Reaction,
    ReactionName,
    Tick,
    Time,
)
from kybflow.core.units import Ratio
from kybflow.flight.tracked_pose import MAX_EXTRAPOLATION_S
from kybflow.parts import Supervisor, param, params
from kybflow.world.vehicle_context import VehicleContext

_ATTITUDE = CommandKind.ATTITUDE_THRUST
_BAND_S = 0.08
_AVERAGING_S = 1.0
_LASTING_NS: Time = NS // 2
_EXPLAINED = 0.25
_MIN_RATE_SQUARE = 0.03**2
"""Mean square of u' below which there is only noise, rad^2/s^2."""
_LEAST_BOUND_S = 0.025
"""The excess is known to about 15 ms, so that a smaller bound would raise false alarms, s."""
_LONGEST_STEP_NS: Time = NS // 10
"""Longest time between two checks, ns, after which it begins anew."""


class _Shares(NamedTuple):
    """By how much the filters follow a change in one step. band, delay, integral: those of the
    band, of the declared delay and of H. averages: those of the products. ahead: D/P, s. turning:
    1 / (P dt)."""

    band: float
    delay: float
    integral: float
    averages: float
    ahead: float
    turning: float


class _Axis:
    """The comparison about one body axis. rates, lags: what H removes of the commanded rate, and of
    w minus it. w: the last turn rate. delayed: u with the declared delay. slow, band: its part
    below the band, and that in it; slow_off, off: the same of y - u."""

    __slots__ = ("band", "delayed", "lags", "off", "rates", "slow", "slow_off", "w")

    def __init__(self, asked: float, tilt: float, w: float) -> None:
        self.delayed = self.slow = asked
        self.slow_off = tilt - asked
        self.w = w
        self.rates = self.lags = self.band = self.off = 0.0

    def step(
        self, asked: float, rate: float, tilt: float, w: float, shares: _Shares
    ) -> tuple[float, float]:
        """Return y - u in the band, averaged over a step, and the change of u in the band. asked,
        rate: the commanded tilt and turn rate. tilt, w: the measured ones."""
        band, delay, integral, _, ahead, turning = shares
        lag = w - rate
        self.rates = rates = self.rates + integral * (rate - self.rates)
        self.lags = lags = self.lags + integral * (lag - self.lags)
        u = asked + ahead * (rate - rates)
        y = tilt + ahead * (w - rates - lags) + turning * (w - self.w)
        self.w = w
        self.delayed = u = self.delayed + delay * (u - self.delayed)
        e = y - u
        self.slow = slow = self.slow + band * (u - self.slow)
        self.slow_off = slow_off = self.slow_off + band * (e - self.slow_off)
        change = band * (u - slow - self.band)
        self.band += change
        before = self.off
        self.off = off = before + band * (e - slow_off - before)
        return 0.5 * (before + off), change


@params
class CommandDelayParams:
    share: Ratio = param(
        "Share of the delay margin that late commands may use up.",
        default=0.75, above=0.0, at_most=1.0, tightens="down",
    )  # fmt: skip
    reaction: ReactionName = param("What the failsafe does.", default="land_blind", tightens="up")


class CommandDelay(Supervisor[CommandDelayParams]):
    always = True
    unhurried = True
    events = ("commands_late",)

    @classmethod
    def can_emit(cls, context: VehicleContext) -> tuple[str, ...]:
        return cls.events if context.delay_margin is not None else ()

    def __init__(self, params: CommandDelayParams, context: VehicleContext) -> None:
        super().__init__(params, context)
        self._loop, self._margin, self._period = context.loop, context.delay_margin, context.dt
        self._axes: tuple[_Axis, _Axis] | None = None
        self._shares = _Shares(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        self._source = ""
        self._looked: Time = 0
        self._step: Time = 0
        self._common = self._moved = self._differed = 0.0
        self._since: Time | None = None
        self._alarm: Alarm | None = None

    def check(self, tick: Tick, off_ground: bool) -> Alarm | None:
        if not off_ground:
            self._axes = self._alarm = None
            return None
        if self._alarm is not None or self._margin is None:
            return self._alarm
        command, estimate, imu, now = tick.command, tick.estimate, tick.imu, tick.now
        step, self._looked = now - self._looked, now
        if (
            command is None
            or command.kind is not _ATTITUDE
            or command.heading is None
            or estimate is None
            or estimate.age > MAX_EXTRAPOLATION_S
            or imu is None
            or now - imu.time > IMU_TIMEOUT
            or tick.link_delay > 0.0
        ):
            self._axes = None
            return None
        asked_x, asked_y = _tilts(command.attitude)
        x, y = _tilts(estimate.attitude)
        rate_x, rate_y, _ = command.rates
        wx, wy, _ = imu.angular_velocity
        if self._axes is None or step > _LONGEST_STEP_NS or estimate.source != self._source:
            self._axes = _Axis(asked_x, x, wx), _Axis(asked_y, y, wy)
            self._source, self._since = estimate.source, None
            self._common = self._moved = self._differed = 0.0
            return None
        if step != self._step:
            self._step, self._shares = step, self._shares_of(step / NS)
        about_x, about_y = self._axes
        ex, ux = about_x.step(asked_x, rate_x, x, wx, self._shares)
        ey, uy = about_y.step(asked_y, rate_y, y, wy, self._shares)
        dt, kept = step / NS, 1.0 - self._shares.averages
        self._common = common = kept * self._common - ex * ux - ey * uy
        self._moved = moved = kept * self._moved + (ux * ux + uy * uy) / dt
        self._differed = differed = kept * self._differed + (ex * ex + ey * ey) * dt
        bound = max(self.params.share * self._margin, _LEAST_BOUND_S)
        if (
            common <= bound * moved
            or moved <= _AVERAGING_S * _MIN_RATE_SQUARE
            or common * common <= _EXPLAINED * moved * differed
        ):
            self._since = None
            return None
        self._since = now if self._since is None else self._since
        if now - self._since < _LASTING_NS:
            return None
        late = common / moved
        reason = f"commands act {late * 1e3:.0f} ms too late, {bound * 1e3:.0f} ms allowed"
        reaction = Reaction[self.params.reaction.upper()]
        self._alarm = Alarm("commands_late", reaction, reason, late, bound, is_failure=True, follows=False)
        return self._alarm

    def _shares_of(self, dt: float) -> _Shares:
        """Return the filters' shares for a step of `dt` seconds."""
        loop = self._loop
        assert loop is not None  # its margin is known
        p, d, i, lead = loop.attitude
        delay = loop.command_latency + loop.dead_time + loop.rotor_time / lead
        delay += 1.5 * self._period  # that of the last tick, held for a period
        return _Shares(
            dt / (_BAND_S + dt), dt / (delay + dt), dt * i / (p + dt * i),
            dt / (_AVERAGING_S + dt), d / p, 1.0 / (p * dt),
        )  # fmt: skip


def _tilts(attitude: Quat) -> tuple[float, float]:
    """Return the tilts about body x and y, as the vertical in body axes shows them."""
    w, x, y, z = attitude
    return 2.0 * (y * z + w * x), 2.0 * (w * y - x * z)
