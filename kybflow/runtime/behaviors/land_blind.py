"""Land without a position: level attitude, a descent controlled by the IMU, then rotors off.

The last resort when the estimate is lost. It needs neither estimator nor tracker: the on-board
controller keeps the attitude level and its heading from the IMU, and the thrust follows the law of
`kybflow.flight.descent`, which holds a speed of about half a metre per second by the measured
specific force, for any error of the thrust model, and detects the touch-down. Touch-down speed in
m/s (time in s), from rest, for an error e of the thrust model:

    from      e = -10 %     0             +10 %
    0.5 m     0.52 (1.2)    0.53 (1.3)    0.54 (1.4)
    1.0 m     0.64 (2.1)    0.65 (2.2)    0.66 (2.3)
    1.5 m     0.76 (2.8)    0.77 (2.9)    0.78 (3.0)
    2.5 m     1.01 (4.0)    1.02 (4.0)    1.03 (4.1)

With an accelerometer error of 0.25 m/s^2, the touch-down speed from 2.5 m is 1.5 m/s (2.9 s) or
1.0 m/s (10 s), depending on the sign of the error. If an estimator needs the IMU, its measurement
at rest on the ground is known and taken as gravity (`kybflow.runtime.vehicle.knowledge`); only a
later change then has this effect.

Level is the attitude at which the tracker held the vehicle still, on average (`Entry.lean`): an
on-board controller whose level is a degree off would let it drift aside by 0.4 m from 1 m, and wind
would carry it along.

It begins at the velocity of the last setpoint if that was within 0.3 m of the last estimate, else
at that of the last estimate, also if commands are late (`commands_late`); if the frame of the
estimate is wrong (`mocap_frame`), at the velocity by the IMU. The horizontal velocity is braked
first, as hard as the airframe's largest tilt allows, by a model of the vehicle
(`kybflow.flight.descent.BlindBrake`) in the vehicle's heading. In a wrong frame the IMU measures
the velocity until the first impact, and the brake goes on until then: an autopilot that took the
wrong poses is a few degrees off when it is commanded to be level. A bump against a wall or another
vehicle is not mistaken for the floor. If commands are late, so that the vehicle bounces on the
floor, a fresh estimate that shows it on the ground and not sinking also ends the landing.

If nothing has arrived from the vehicle for 0.25 s, no command is sent either: the vehicle lands by
its own watchdog, which the preflight has checked and which reads the IMU.

If only IMU samples are missing for 0.1 s, the thrust is an open-loop function of the time since the
entry, for the rest of the descent:

    T(t) = T0 (1 - (1 - share) min(t / settle, 1) - fade max(t - settle, 0)
               - 2 vz0 / (g tau) max(1 - t / tau, 0)),      tau = 0.8 s

where T0 is the tracker's estimate of the hover thrust (or that of the closed-loop descent, once it
has one) and vz0 the vertical speed at entry, which the last term reduces to zero. The closed-loop
descent ends with the touch-down; in open loop the rotors stop after `time_bound`, unless an
estimate shows the vehicle in the air. If the vehicle is already on the ground, the behavior ends at
once.

Open loop the vehicle obeys z.. = g ((1 + e) T / T0 - 1) - d z.; a share of 90 % is the most that
still lets a vehicle with e = +10 % sink, so e = -10 % falls with a net acceleration of 0.19 g.
Touch-down speed in m/s (time in s), from rest, drag d = 0.3 1/s:

    open loop e = -10 %     -5 %          0            +5 %          +10 % (time; initial climb)
    1.0 m     1.66 (1.3)    1.45 (1.6)    1.22 (2.0)   1.00 (3.0)    0.98 (5.8; 0.56 m)
    1.5 m     2.03 (1.6)    1.76 (1.9)    1.48 (2.4)   1.20 (3.4)    1.14 (6.3; 0.56 m)
    2.5 m     2.57 (2.0)    2.23 (2.4)    1.86 (3.0)   1.51 (4.2)    1.40 (7.1; 0.56 m)

Even the full T0, which would let e > 0 climb for ever, lands e = -10 % from 2.5 m with 1.75 m/s: no
open-loop ramp is gentle for every error, this one is bounded for all of them.
"""

from __future__ import annotations

from kybflow.core.geometry import (
    GRAVITY,
    LEVEL,
    ZERO,
    body_z,
    from_thrust_direction,
    heading_of,
)
from kybflow.core.signals import NS, Command, CommandKind, Done, Estimate, Imu, Tick, Time
from kybflow.core.units import Damping, Duration, Ratio
from kybflow.flight.descent import BlindBrake, Descent
from kybflow.flight.motion import IDLE
from kybflow.parts import AIR, GROUND, MOVING, Behavior, Entry, param, params
from kybflow.world.ground import FRESH_S, height_in_the_air

_ARREST_TIME_S = 0.8
_MAX_KICK = 0.3
_MAX_SAMPLE_S = 0.25
"""Longest interval (s) of one IMU sample."""
_IMU_TIMEOUT_NS = NS // 10
"""Time without an IMU sample after which the descent continues in open loop."""
_SINK_SPEED = -0.1
_CLIMB_LAG_S = 0.06
"""By how much the climb rate of an estimate lags behind, s: 2 / (2 pi 5 Hz) in `mocap`.
A vehicle whose vertical loop oscillates reaches 8 m/s^2."""
_LINK_TIMEOUT_S = 0.25
"""Seconds without a message from the vehicle after which its own watchdog must land it."""


@params
class LandBlindParams:
    share: Ratio = param(
        "Share of the hover thrust that is left after `settle`.",
        default=0.9, above=0.5, below=1.0, read_only=True,
    )  # fmt: skip
    settle: Duration = param(
        "Time in which the thrust goes down to `share`.", default=1.0, above=0.0, read_only=True
    )
    fade: Damping = param(
        "Share of the hover thrust by which the thrust then falls each second.",
        default=0.01, above=0.0, read_only=True,
    )  # fmt: skip
    time_bound: Duration = param(
        "Time after which the rotors stop if there is no IMU; long enough for the slowest "
        "descent from the mission's greatest height.",
        default=12.0, above=0.0, read_only=True,
    )  # fmt: skip


class LandBlind(
    Behavior[LandBlindParams],
    flight=(AIR >> GROUND, MOVING >> GROUND, GROUND >> GROUND),
    emits=CommandKind.ATTITUDE_THRUST,
    needs_estimate=False,
):
    needs = frozenset({Imu})

    def __init__(self, params: LandBlindParams, entry: Entry) -> None:
        super().__init__(params, entry)
        self._grounded, self._context = entry.flight is GROUND, entry.context
        self._late = entry.late
        self._hover = entry.hover_thrust
        self._most = entry.context.airframe.max_thrust
        known, felt = entry.known, entry.imu_motion
        if felt is None:
            vx, vy, climb = entry.motion.velocity
            ax, ay, _ = (entry.setpoint and entry.setpoint.acceleration) or ZERO
            if entry.late and entry.estimate is not None:
                ux, uy, uz = body_z(entry.estimate.attitude)
                drag = entry.context.airframe.drag
                ax, ay = GRAVITY * ux - drag * vx, GRAVITY * uy - drag * vy
                if entry.imu is not None:
                    climb += _CLIMB_LAG_S * (uz * entry.imu.specific_force[2] - GRAVITY)
            self._heading = entry.heading if known is None else heading_of(known.attitude)
        else:
            vx, vy, climb = felt.velocity
            ax, ay, _ = felt.acceleration
            self._heading = 0.0
        self._brake = BlindBrake((vx, vy), (ax, ay), entry.context.airframe, entry.late)
        self._lean = (0.0, 0.0) if known is None else entry.lean
        self._kick = min(max(-2.0 * climb / (GRAVITY * _ARREST_TIME_S), -_MAX_KICK), _MAX_KICK)
        self._descent: Descent | None = Descent(
            self._hover, self._most, climb, entry.resting_force, late=entry.late
        )
        self._heard: Time = entry.now
        self._last: Imu | None = None
        self._felt: float | None = None

    def update(self, tick: Tick) -> Command | Done:
        if self._grounded:
            return Done(IDLE)
        if tick.imu_motion is not None and self._descent and not self._descent.was_struck:
            self._brake.measure(tick.imu_motion)
        leant, pull = self._brake.lean, self._brake.step(tick.dt)
        if self._descent is not None and self._landed(self._descent, tick, leant):
            return Done(IDLE)
        if self._late and self._stands(tick.sound_estimate):
            return Done(IDLE)
        if self._descent is None and tick.elapsed >= self.params.time_bound:
            known = tick.estimate
            if known is None or height_in_the_air(self._context, known, ()) <= 0.0:
                return Done(IDLE)
        self.lets_go = self._descent is None and tick.link_age > _LINK_TIMEOUT_S
        self.waits_for = "its own watchdog, because the link is silent" if self.lets_go else None
        thrust = self._felt
        if thrust is None:
            p, time = self.params, tick.elapsed
            share = 1.0 - (1.0 - p.share) * min(time / p.settle, 1.0)
            share = share - p.fade * max(time - p.settle, 0.0)
            thrust = self._hover * (share + self._kick * max(1.0 - time / _ARREST_TIME_S, 0.0))
        attitude, lean = LEVEL, self._lean
        if pull is not None or any(lean):
            x, y, z = pull or (0.0, 0.0, GRAVITY)
            attitude = from_thrust_direction((x + z * lean[0], y + z * lean[1], z), self._heading)
        return Command(attitude, min(max(thrust / leant, 0.0), self._most), ZERO, None)

    def _stands(self, known: Estimate | None) -> bool:
        """Return whether a fresh estimate shows the vehicle on the ground and not sinking."""
        if known is None or known.age > FRESH_S or known.velocity[2] < _SINK_SPEED:
            return False
        return height_in_the_air(self._context, known, ()) <= 0.0

    def _landed(self, descent: Descent, tick: Tick, leant: float) -> bool:
        """Process the newest IMU sample; return whether the vehicle has touched down. If no sample
        has arrived for too long, change to the open-loop descent. leant: the cosine of the tilt."""
        imu, last = tick.imu, self._last
        if imu is not None and imu.time > self._heard:
            total = sum(imu.specific_force)  # noise makes each sample differ from the last one
            stuck = last is not None and last.specific_force == imu.specific_force
            if total - total == 0.0 and 0.0 < imu.dt < _MAX_SAMPLE_S and not stuck:
                self._heard, self._last = imu.time, imu
                self._felt = descent.step(leant * imu.specific_force[2], imu.dt)
                return self._felt is None
        if tick.now - self._heard > _IMU_TIMEOUT_NS:
            self._descent, self._felt, self._hover = None, None, descent.hover
        return False
