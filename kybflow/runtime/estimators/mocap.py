"""State from motion capture: pose by pose, velocities by a filtered derivative, predicted to now.

The derivative is TeleKyb's second-order filter H(s) = wn^2 s / (s^2 + 2 wn s + wn^2), but by the
poses' own time stamps: an alpha-beta filter whose poles stay at exp(-wn dt) for whatever dt
(critically damped: alpha = 1 - theta^2, beta = (1 - theta)^2, theta = exp(-wn dt); Brookner,
"Tracking and Kalman Filtering Made Easy", 1998, sec. 1.3). The lag 2/wn of H is filled in by the
acceleration that the attitude and the airframe's rotor drag tell: g times the slope of body z,
less drag times velocity, horizontally. Noisy poses are filtered harder, because a tracker amplifies
the noise of the velocity: from the 60th pose on the bandwidth is divided by 1 + (spread / 15 mm)^2,
at most by 3.

Attitude and body rates go through the same filter on the rotation, which has no sign to flip. The
estimate is predicted over the latency to `now`. A pose whose stamp is not newer than the last one's
is dropped, and so is one that is none (a lost body: not finite, or no rotation). After a gap longer
than `gap` the filter starts again, and until `samples` poses have come there is no estimate.
spread: running standard deviation of the innovation along an axis, metres.

A pose that no flight explains is dropped as well (two bodies exchanged, a reflection taken for a
marker), so that the estimate ages and stops being healthy (`kybflow.runtime.pose_gate`).
"""

from __future__ import annotations

from collections.abc import Sequence
from math import exp, pi, sqrt

from kybflow.geometry import GRAVITY, LEVEL, ZERO, Vec3, add, distance, integrate, scale
from kybflow.parts import Estimator, param, params
from kybflow.runtime.pose_gate import (
    LOOK_AHEAD,
    UNKNOWN_PACE,
    PoseGate,
    Reference,
    is_same,
    seen_from,
)
from kybflow.signals import NS, Estimate, Measurement, MeasurementKind, Pose, Time
from kybflow.site import Site
from kybflow.units import Duration, Frequency, Length

STEEPEST = 0.5
"""Body z at least this far up for its slope to tell an acceleration."""
NOISY, CALMEST, WARM = 0.015, 3.0, 60


@params
class MocapParams:
    velocity_bandwidth: Frequency = param(
        "Bandwidth of the filtered derivative that gives the velocity.",
        default=5.0, above=0.0, at_most=60.0,
    )  # fmt: skip
    rate_bandwidth: Frequency = param(
        "Bandwidth of the filtered derivative that gives the body rates.",
        default=10.0, above=0.0, at_most=60.0,
    )  # fmt: skip
    gap: Duration = param(
        "Time without a pose after which the filter starts again.", default=0.5, above=0.0
    )
    samples: int = param("Poses before there is an estimate.", default=5, at_least=2)
    memory: Duration = param("Time over which the spread is taken.", default=0.25, above=0.0)
    gate: Length = param(
        "How far a pose may be from the predicted one, beside four times the spread and what an "
        "unknown acceleration explains.",
        default=0.1, above=0.0, tightens="down",
    )  # fmt: skip
    widest_gate: Length = param(
        "How far it may be at most, however long the last pose was ago.",
        default=0.5, above=0.0, tightens="down",
    )  # fmt: skip
    settled: Duration = param(
        "How long poses must have been consistent elsewhere, nothing else being flown on, before "
        "the vehicle counts as carried there; longer than any landing.",
        default=20.0, above=0.0,
    )  # fmt: skip


class Mocap(Estimator[MocapParams]):
    """See the module."""

    needs = frozenset({MeasurementKind.POSE})

    def __init__(self, params: MocapParams, site: Site) -> None:
        super().__init__(params, site)
        self._drag = site.airframe.drag
        self._stamp: Time = 0
        self._count = 0
        self._variance = 0.0
        self._position = ZERO
        self._velocity = ZERO
        self._acceleration = ZERO
        self._attitude = LEVEL
        self._rates = ZERO
        self._gate = PoseGate()
        self._known = False

    def update(self, measurements: Sequence[Measurement], now: Time) -> Estimate | None:
        for pose in measurements:
            if isinstance(pose, Pose) and _is_sound(pose):
                self._take(pose)
        if self._count < self.params.samples:
            return None
        self._known = True
        age = (now - self._stamp) / NS
        px, py, pz = self._position
        vx, vy, vz = self._velocity
        ax, ay, az = self._acceleration
        h = 0.5 * age
        return Estimate(
            now,
            (px + age * (vx + h * ax), py + age * (vy + h * ay), pz + age * (vz + h * az)),
            (vx + age * ax, vy + age * ay, vz + age * az),
            integrate(self._attitude, self._rates, age),
            self._rates,
            "mocap",
            age,
            sqrt(self._variance),
        )

    def anchor(self, estimate: Estimate) -> None:
        self._gate.flown = estimate

    def _take(self, pose: Pose) -> None:
        dt = (pose.time - self._stamp) / NS
        if self._count > 0 and dt <= 0.0:
            return
        flown = self._gate.current(pose.time)
        if not self._passes(pose, dt, flown):
            return
        if self._count == 0 or dt > self.params.gap:
            self._start(pose, ZERO if flown is None else flown.velocity)
        else:
            self._count += 1
            self._stamp = pose.time
            self._move(pose, dt)
            self._turn(pose, dt)
            self._acceleration = self._slope()

    def _passes(self, pose: Pose, dt: float, flown: Estimate | None) -> bool:
        """Whether this is the vehicle; where nobody knew one yet, the filter starts at it."""
        if self._count == 0 or (flown is None and self._is_near(pose, dt)):
            return True
        p, gate = self.params, self._gate
        reference = self._believed(dt) if flown is None else seen_from(flown, pose.time)
        if gate.passes(pose, reference, p.gate, p.widest_gate):
            return True
        if not self._known or gate.settled(pose, p.settled):
            self._count = 0
            return True
        return False

    def _is_near(self, pose: Pose, dt: float) -> bool:
        """The same for what nearly every pose is, the quick way."""
        (x, y, z), (vx, vy, vz) = self._position, self._velocity
        off = distance(pose.position, (x + dt * vx, y + dt * vy, z + dt * vz))
        return off < self.params.gate and dt < LOOK_AHEAD and is_same(pose.attitude, self._attitude)

    def _believed(self, dt: float) -> Reference:
        ahead = min(dt, LOOK_AHEAD)
        return Reference(
            self._stamp,
            add(self._position, scale(self._velocity, ahead)),
            integrate(self._attitude, self._rates, ahead),
            sqrt(self._variance),
            UNKNOWN_PACE if self._count < self.params.samples else 0.0,
        )

    def _start(self, pose: Pose, velocity: Vec3) -> None:
        self._count = 1
        self._stamp = pose.time
        self._variance = 0.0
        self._position, self._attitude = pose.position, pose.attitude
        self._velocity = velocity
        self._rates = self._acceleration = ZERO

    def _move(self, pose: Pose, dt: float) -> None:
        mx, my, mz = pose.position
        px, py, pz = self._position
        vx, vy, vz = self._velocity
        ax, ay, az = self._acceleration
        h = 0.5 * dt
        px, py, pz = px + dt * (vx + h * ax), py + dt * (vy + h * ay), pz + dt * (vz + h * az)
        ix, iy, iz = mx - px, my - py, mz - pz
        calm = 1.0
        if self._count > WARM:
            calm = min(1.0 + self._variance / (NOISY * NOISY), CALMEST)
        theta = exp(-2.0 * pi * self.params.velocity_bandwidth / calm * dt)
        a, b = 1.0 - theta * theta, (1.0 - theta) ** 2 / dt
        self._position = (px + a * ix, py + a * iy, pz + a * iz)
        self._velocity = (vx + dt * ax + b * ix, vy + dt * ay + b * iy, vz + dt * az + b * iz)
        share = dt / (self.params.memory + dt)
        self._variance += share * ((ix * ix + iy * iy + iz * iz) / 3.0 - self._variance)

    def _turn(self, pose: Pose, dt: float) -> None:
        w, x, y, z = integrate(self._attitude, self._rates, dt)
        mw, mx, my, mz = pose.attitude
        two = 2.0 if w * mw + x * mx + y * my + z * mz >= 0.0 else -2.0
        ix = two * (w * mx - x * mw - y * mz + z * my)
        iy = two * (w * my + x * mz - y * mw - z * mx)
        iz = two * (w * mz - x * my + y * mx - z * mw)
        theta = exp(-2.0 * pi * self.params.rate_bandwidth * dt)
        a, b = 1.0 - theta * theta, (1.0 - theta) ** 2 / dt
        rx, ry, rz = self._rates
        self._attitude = integrate((w, x, y, z), (ix, iy, iz), a)
        self._rates = (rx + b * ix, ry + b * iy, rz + b * iz)

    def _slope(self) -> tuple[float, float, float]:
        """The horizontal acceleration that the attitude tells, thrust holding the weight."""
        w, x, y, z = self._attitude
        up = 1.0 - 2.0 * (x * x + y * y)
        if up < STEEPEST:
            return ZERO
        k = 2.0 * GRAVITY / up
        vx, vy, _ = self._velocity
        return (
            k * (x * z + w * y) - self._drag * vx,
            k * (y * z - w * x) - self._drag * vy,
            0.0,
        )


def _is_sound(pose: Pose) -> bool:
    (px, py, pz), (w, x, y, z) = pose.position, pose.attitude
    total = px + py + pz
    return total - total == 0.0 and 0.9 < w * w + x * x + y * y + z * z < 1.1
