"""Come down without knowing where: level attitude, thrust ramped down from hover, then rotors off.

The last resort when the estimate is lost. It needs neither estimator nor tracker: the on-board
controller keeps the attitude level and its heading from the IMU, and the thrust is an open-loop
function of time,

    T(t) = T0 (1 - (1 - share) min(t / settle, 1) - fade max(t - settle, 0)
               - 2 vz0 / (g tau) max(1 - t / tau, 0)),      tau = 0.8 s

T0 being the thrust that the tracker believed to hold the vehicle and vz0 the vertical speed at
entry, which the last term takes away. After `time_bound` the rotors stop. On the ground it is done
at once.

The vehicle obeys z.. = g ((1 + e) T / T0 - 1) - d z.; e is the error of the thrust model. A share
of 90 % is the most that still lets a vehicle with e = +10 % sink, so e = -10 % falls with a net
acceleration of up to 0.19 g. Touch-down speed in m/s (time in s), from rest, drag d = 0.3 1/s:

    from      e = -10 %     -5 %          0            +5 %          +10 % (climbs first by)
    1.0 m     1.66 (1.3)    1.45 (1.6)    1.22 (2.0)   1.00 (3.0)    0.98 (5.8; 0.56 m)
    1.5 m     2.03 (1.6)    1.76 (1.9)    1.48 (2.4)   1.20 (3.4)    1.14 (6.3; 0.56 m)
    2.5 m     2.57 (2.0)    2.23 (2.4)    1.86 (3.0)   1.51 (4.2)    1.40 (7.1; 0.56 m)

Even the full T0, which would let e > 0 climb for ever, lands e = -10 % from 2.5 m with 1.75 m/s: no
open-loop ramp is gentle for every error, this one is bounded for all of them.
"""

from __future__ import annotations

from kybflow.geometry import GRAVITY, LEVEL, ZERO
from kybflow.parts import AIR, GROUND, MOVING, Behavior, Entry, param, params
from kybflow.runtime.motion import IDLE, entry_motion
from kybflow.signals import Command, CommandKind, Done, Tick
from kybflow.units import Damping, Duration, Ratio

_ARREST = 0.8
_MOST = 0.3


@params
class LandBlindParams:
    share: Ratio = param(
        "Share of the hover thrust that is left after `settle`.",
        default=0.9,
        above=0.5,
        below=1.0,
        read_only=True,
    )
    settle: Duration = param(
        "Time in which the thrust goes down to `share`.", default=1.0, above=0.0, read_only=True
    )
    fade: Damping = param(
        "Share of the hover thrust that is taken away each second after that.",
        default=0.01,
        above=0.0,
        read_only=True,
    )
    time_bound: Duration = param(
        "Time after which the rotors stop; long enough for the slowest descent from the mission's "
        "greatest height.",
        default=12.0,
        above=0.0,
        read_only=True,
    )


class LandBlind(
    Behavior[LandBlindParams],
    flight=(AIR >> GROUND, MOVING >> GROUND, GROUND >> GROUND),
    emits=CommandKind.ATTITUDE_THRUST,
    needs_estimate=False,
):
    def __init__(self, params: LandBlindParams, entry: Entry) -> None:
        super().__init__(params, entry)
        self._grounded = entry.flight is GROUND
        self._hover = entry.hover_thrust
        self._most = entry.site.airframe.max_thrust
        kick = -2.0 * entry_motion(entry).velocity[2] / (GRAVITY * _ARREST)
        self._kick = min(max(kick, -_MOST), _MOST)

    def update(self, tick: Tick) -> Command | Done:
        if self._grounded or tick.elapsed >= self.params.time_bound:
            return Done(IDLE)
        thrust = self._hover * self._share_at(tick.elapsed)
        return Command(LEVEL, min(max(thrust, 0.0), self._most), ZERO, None)

    def _share_at(self, time: float) -> float:
        p = self.params
        ramp = (
            1.0 - (1.0 - p.share) * min(time / p.settle, 1.0) - p.fade * max(time - p.settle, 0.0)
        )
        return ramp + self._kick * max(1.0 - time / _ARREST, 0.0)
