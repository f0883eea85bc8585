"""Report a vehicle that follows its commands later than its position loop can bear.

Alarm `commands_late` in the air when commands take effect so much later than the driver declares
that `share` of the loop's delay margin (`kybflow show` prints it) is used up. Beyond the margin the
vehicle oscillates ever more. The alarm then lasts for as long as the vehicle flies.

The evidence is the vehicle's motion: y, which shows the command that the vehicle obeys, is compared
with the command u. About body x and y, with the gains of the on-board loop
(`kybflow.world.vehicle_context`), H = s / (s + I / P) for its integral and the turn rate w,

    u = tilt commanded + D/P H rate commanded,    y = integral of w + D/P H w + w' / P,

so that y = u after the rotors' lag, whatever estimator the tilt is commanded from: wind moves the
vehicle without turning it, and torques are seldom in step with u. Along body z, u is the commanded
thrust over the weight, y the specific force over g. u is first delayed by what the driver declares.
In the band around 1 / `_BAND_S`, in which these loops oscillate, the excess L and an error k of the
amplitude (of the mass, or where rotors saturate) follow from the regression, averaged over
`_AVERAGING_S`, y(t) = (1 + k) u(t - L) or nearly y - u = k u - L u' In an oscillation of the
frequency f this finds sin(f L) / f: somewhat too little, but never less than zero, since an
oscillating loop lags by less than half a turn. L counts if it is above the bound for long enough,
if u moves, and if L explains enough of what k u does not explain of y - u, which it doesn't of
noise and gusts. Vertically, where rotors shake the accelerometer, u must move more. On the floor,
which may hold the vehicle, nothing is judged.

In flights of four airframes with margins of 51 to 58 ms (hovering, on an eight, landing), commands
that are 30 ms late were never taken for late. 100 ms were noticed after 1 to 2.8 s, and 60 ms,
which make the vehicle oscillate slowly, after 2 to 30 s. L is known to about 15 ms, so the bound is
at least 25 ms, also if the margin is smaller. A loop that oscillates for another reason, such as an
airframe that differs by a fifth from what is declared, is noticed too.

Without a tracker that commands attitudes in a loop whose margin is known, or without an IMU,
nothing is judged; nor where the link measures round trips, because `link` then watches these. The
margin is that of the gains at the start. The default reaction is `land_blind`, which opens the
loop: every other one is flown by it. Body frame, radians, seconds.
"""

from __future__ import annotations

from typing import NamedTuple

from kybflow.core.geometry import GRAVITY, Quat
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
from kybflow.world.ground import FLOOR
from kybflow.world.vehicle_context import VehicleContext

_ATTITUDE = CommandKind.ATTITUDE_THRUST
_BAND_S, _AVERAGING_S = 0.08, 1.0
_LEAST_BOUND_S = 0.025
"""A smaller bound would raise false alarms."""
_LONGEST_STEP_NS: Time = NS // 10
"""Longest time between two checks, ns; after a longer one it begins anew."""


class _Evidence(NamedTuple):
    """What is enough evidence. rate: root mean square of u', 1/s. explained: share of y - u. lasts:
    for how long L must be far above the bound, ns."""

    rate: float
    explained: float
    lasts: Time


_TURNS = _Evidence(0.25, 0.25, NS // 2)
_CLIMBS = _Evidence(0.3, 0.5, NS // 5)
_FAR, _NEAR = 1.3, 3
"""L over the bound that is far above it, and how many times as long a smaller L must last."""
_LOW = 0.1
"""Height above the floor, and distance from the height where it stood, at which the vehicle may
touch something, m."""
_Products = tuple[float, float, float]
"""In the band and in a step: y - u and u, each averaged over the step, and the change of u."""


class _Shares(NamedTuple):
    """By how much the filters follow a change in one step. band, delay, integral: those of the
    band, of the declared delay and of H. averages: those of the products. ahead: D/P, s. turning:
    1 / (P dt). dt: the step, s."""

    band: float
    delay: float
    integral: float
    averages: float
    ahead: float
    turning: float
    dt: float


class _Channel:
    """Compares u with y. delayed: u after the declared delay. slow, band: its parts below the band
    and in it; slow_off, off: those of y - u."""

    __slots__ = ("band", "delayed", "off", "slow", "slow_off")

    def __init__(self, u: float, y: float) -> None:
        self.delayed = self.slow = u
        self.slow_off = y - u
        self.band = self.off = 0.0

    def step(self, u: float, y: float, shares: _Shares) -> _Products:
        """Return what is in the band."""
        band, before, last = shares[0], self.off, self.band
        self.delayed = u = self.delayed + shares[1] * (u - self.delayed)
        e = y - u
        self.slow = slow = self.slow + band * (u - self.slow)
        self.slow_off = slow_off = self.slow_off + band * (e - self.slow_off)
        change = band * (u - slow - last)
        self.band = last + change
        self.off = off = before + band * (e - slow_off - before)
        return 0.5 * (before + off), last + 0.5 * change, change


class _Turning(_Channel):
    """Computes u and y about a body axis. rates, lags: what H removes of the commanded rate, and of
    w less that. tilt: the integral of w, the last turn rate."""

    __slots__ = ("lags", "rates", "tilt", "w")

    def __init__(self, asked: float, w: float) -> None:
        super().__init__(asked, asked)
        self.rates = self.lags = 0.0
        self.tilt, self.w = asked, w

    def turn(self, asked: float, rate: float, w: float, shares: _Shares) -> _Products:
        """Return what is in the band. asked, rate: the commanded tilt and turn rate. w: the
        measured rate."""
        _, _, integral, _, ahead, turning, dt = shares
        lag, last = w - rate, self.w
        self.tilt = tilt = self.tilt + 0.5 * dt * (w + last)
        self.rates = rates = self.rates + integral * (rate - self.rates)
        self.lags = lags = self.lags + integral * (lag - self.lags)
        self.w = w
        y = tilt + ahead * (w - rates - lags) + turning * (w - last)
        return self.step(asked + ahead * (rate - rates), y, shares)


class _Judge:
    """Averages the products of one or two channels. e: y - u. v: the change of u."""

    __slots__ = ("_ee", "_enough", "_eu", "_ev", "_far", "_since", "_uu", "_uv", "_vv")

    def __init__(self, enough: _Evidence) -> None:
        self._enough = enough
        self._ee = self._eu = self._ev = self._uu = self._uv = self._vv = 0.0
        self._since: Time | None = None
        self._far: Time | None = None

    def late(self, bound: float, now: Time, shares: _Shares, *seen: _Products) -> float:
        """Add what was seen in a step; return L (s) if it is above the bound, with enough evidence,
        and otherwise 0."""
        dt, kept = shares.dt, 1.0 - shares.averages
        ee, eu, ev = kept * self._ee, kept * self._eu, kept * self._ev
        uu, uv, vv = kept * self._uu, kept * self._uv, kept * self._vv
        for e, u, v in seen:
            ee, eu, ev = ee + e * e * dt, eu + e * u * dt, ev + e * v
            uu, uv, vv = uu + u * u * dt, uv + u * v, vv + v * v / dt
        self._ee, self._eu, self._ev, self._uu, self._uv, self._vv = ee, eu, ev, uu, uv, vv
        whole, part = uu * vv - uv * uv, eu * uv - ev * uu
        if part <= bound * whole:
            self._since = self._far = None
            return 0.0
        rate, explained, lasts = self._enough
        if vv <= _AVERAGING_S * rate * rate or part * part <= explained * whole * (
            ee * uu - eu * eu
        ):
            self._since = self._far = None
            return 0.0
        self._since = now if self._since is None else self._since
        if part <= _FAR * bound * whole:
            self._far = None
        elif self._far is None:
            self._far = now
        far = self._far
        is_late = now - self._since >= _NEAR * lasts or (far is not None and now - far >= lasts)
        return part / whole if is_late else 0.0


class _Compared(NamedTuple):
    """The comparisons since the estimator `source` is in use."""

    source: str
    x: _Turning
    y: _Turning
    z: _Channel
    turns: _Judge
    climbs: _Judge


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
        self._per_weight = 1.0 / context.airframe.hover_thrust
        self._compared: _Compared | None = None
        self._shares = _Shares(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        self._step: Time = 0
        self._looked: Time = 0
        self._stood = 0.0
        self._alarm: Alarm | None = None

    def check(self, tick: Tick, off_ground: bool) -> Alarm | None:
        command, estimate, imu, now = tick.command, tick.estimate, tick.imu, tick.now
        if not off_ground:
            self._compared = self._alarm = None
            self._stood = 0.0 if estimate is None else estimate.position[2]
            return None
        if self._alarm is not None or self._margin is None:
            return self._alarm
        step, self._looked = now - self._looked, now
        if (
            command is None
            or command.kind is not _ATTITUDE
            or command.heading is None
            or estimate is None
            or estimate.age > MAX_EXTRAPOLATION_S
            or (height := estimate.position[2]) < FLOOR + _LOW
            or abs(height - self._stood) < _LOW
            or imu is None
            or now - imu.time > IMU_TIMEOUT
            or tick.link_delay > 0.0
        ):
            self._compared = None
            return None
        asked_x, asked_y = _tilts(command.attitude)
        rate_x, rate_y, _ = command.rates
        wx, wy, _ = imu.angular_velocity
        thrust, lift = self._per_weight * command.thrust, imu.specific_force[2] / GRAVITY
        compared = self._compared
        if compared is None or step > _LONGEST_STEP_NS or compared[0] != estimate.source:
            x, y = _Turning(asked_x, wx), _Turning(asked_y, wy)
            z = _Channel(thrust, lift)
            self._compared = _Compared(estimate.source, x, y, z, _Judge(_TURNS), _Judge(_CLIMBS))
            return None
        if step != self._step:
            self._step, self._shares = step, self._shares_of(step / NS)
        _, x, y, z, turns, climbs = compared
        shares, bound = self._shares, max(self.params.share * self._margin, _LEAST_BOUND_S)
        about_x = x.turn(asked_x, rate_x, wx, shares)
        about_y = y.turn(asked_y, rate_y, wy, shares)
        late = turns.late(bound, now, shares, about_x, about_y)
        late = max(late, climbs.late(bound, now, shares, z.step(thrust, lift, shares)))
        if late == 0.0:
            return None
        reason = f"commands act {late * 1e3:.0f} ms too late, {bound * 1e3:.0f} ms allowed"
        reaction = Reaction[self.params.reaction.upper()]
        self._alarm = Alarm(
            "commands_late", reaction, reason, late, bound, is_failure=True, late=late
        )
        return self._alarm

    def _shares_of(self, dt: float) -> _Shares:
        """Return the filters' shares for a step of `dt` seconds."""
        loop = self._loop
        assert loop is not None  # its margin is known
        p, d, i, lead = loop.attitude
        delay = loop.command_latency + loop.dead_time + loop.rotor_time / lead
        delay += 1.5 * self._period  # the command is that of the last tick, and held for a period
        return _Shares(
            dt / (_BAND_S + dt), dt / (delay + dt), dt * i / (p + dt * i),
            dt / (_AVERAGING_S + dt), d / p, 1.0 / (p * dt), dt,
        )  # fmt: skip


def _tilts(attitude: Quat) -> tuple[float, float]:
    """Return the tilts about body x and y, as the vertical in body axes shows them."""
    w, x, y, z = attitude
    return 2.0 * (y * z + w * x), 2.0 * (w * y - x * z)
