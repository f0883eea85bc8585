"""The estimator of an emulated autopilot: attitude, position and velocity, and how long each stays
valid without measurements.

As on the firmware, the parameters select the sensors. The local frame (ENU here, NED in messages)
is that of external vision, or begins at the first GPS fix.

As in the firmwares' filters, a measurement is tested by its innovation, its difference from the
estimate, separately along the horizontal and the vertical. The reported ratio to the largest
accepted innovation (`Innovations`) is the last one in ArduPilot; in PX4 its square is averaged over
0.5 s and limited to 4 (`updateAidSourceStatus` in PX4's `ekf.h`).
"""

from __future__ import annotations

from collections.abc import Callable
from math import hypot, sqrt
from typing import NamedTuple

from kybflow.core.geometry import GRAVITY, ZERO, Vec3, rotate, wrap
from kybflow.core.signals import NS, Imu, Time
from kybflow.drivers.emulation.estimation import AttitudeFilter, PositionObserver

VISION_GAIN, FIX_GAIN, PRESSURE_GAIN = 4.0, 0.7, 1.5
"""Bandwidths of the observer's corrections by vision, GPS and the barometer, rad/s."""
GATE = 0.5
"""The largest accepted innovation, metres."""
REJECTION_TIME_NS: Time = NS
"""How long measurements are rejected before the position jumps to them."""
MAX_AGE_NS: Time = 3 * NS // 10
"""The greatest age of a pose: the filter runs 0.2 s behind and accepts poses up to 0.1 s older, as
in PX4 (EKF2_DELAY_MAX) and in ArduPilot's EKF3."""
MAX_CLOCK_ERROR_NS: Time = 10 * NS
"""A stamp that differs by more than this is from another clock; the arrival time is used
instead."""
MAX_TURN = 1.0
"""The largest accepted innovation of the heading, radians."""
MAX_SQUARE = 4.0
"""The largest square of a ratio that counts."""
SETTLING_TIME_NS: Time = NS
"""How long the attitude takes to settle after the start."""


class VisionPose(NamedTuple):
    """A pose from external vision. heading: None if the pose has none. resets: the sender's reset
    counter."""

    time: Time
    position: Vec3
    heading: float | None
    resets: int


class Innovations(NamedTuple):
    """The innovations divided by the largest accepted ones: above 1 a measurement is rejected."""

    position: float
    height: float
    heading: float


class Sources(NamedTuple):
    """The sensors that the parameters select."""

    vision: bool
    vision_height: bool
    vision_heading: bool
    gps: bool
    compass: bool


class SightingClock:
    """Converts the stamps of poses to the vehicle's clock. The delay of the first pose is
    attributed to the sender's clock. adopts: the number of late poses in a row after which their
    delay is attributed to it again (ArduPilot's jitter correction); None if stamps are trusted, as
    in PX4."""

    def __init__(self, adopts: int | None) -> None:
        self._adopts = adopts
        self._late = 0
        self._ahead: Time | None = None if adopts is not None else 0

    def true_at(self, stamp: Time, now: Time) -> Time | None:
        """Return when a pose was measured; None if the pose is too old for the filter."""
        if self._ahead is None:
            self._ahead = now - stamp
        age = now - stamp - self._ahead
        if abs(age) > MAX_CLOCK_ERROR_NS:
            return now
        if age < 0 and self._adopts is not None:
            self._ahead += age
        if age <= MAX_AGE_NS:
            self._late = 0
            return now - max(age, 0)
        self._late += 1
        if self._late == self._adopts:
            self._late, self._ahead = 0, self._ahead + age
        return None


class EmulatedEstimator:
    """The estimator of one vehicle.

    sources: returns the sensors that the parameters select.
    forgets: seconds without measurements after which the position is invalid.
    waits: seconds from the first GPS fix until there is a position.
    adopts: as in `SightingClock`.
    averages: seconds over which the squares of innovations are averaged."""

    def __init__(
        self, sources: Callable[[], Sources], *, forgets: float, waits: float, adopts: int | None,
        averages: float,
    ) -> None:  # fmt: skip
        self.attitude = AttitudeFilter(0.0)
        self.imu: Imu | None = None
        self.acceleration: Vec3 = ZERO
        self._sources, self._forgets, self._waits = sources, forgets, waits
        self._averages, self._tested = averages, 0
        self._squares = (0.0, 0.0, 0.0)
        self._observer = PositionObserver()
        self._clock = SightingClock(adopts)
        self._fixed: Time | None = None
        self._vision: Time | None = None
        self._aimed: Time | None = None
        self._rejecting: Time | None = None
        self._resets: int | None = None
        self._first_fix: tuple[Time, Vec3] | None = None
        self._height: Time | None = None
        self._pressure: tuple[Time, float] | None = None

    @property
    def position(self) -> Vec3:
        return self._observer.position

    @property
    def velocity(self) -> Vec3:
        return self._observer.velocity

    @property
    def local_zero(self) -> Vec3 | None:
        """The position of the first GPS fix, None before it."""
        return None if self._first_fix is None else self._first_fix[1]

    @property
    def innovations(self) -> Innovations:
        return Innovations(*map(sqrt, self._squares))

    def unseen(self, now: Time) -> float | None:
        """Return the seconds since the last measurement of the position; None before the first."""
        return None if self._fixed is None else (now - self._fixed) / NS

    def has_position(self, now: Time) -> bool:
        unseen = self.unseen(now)
        return unseen is not None and unseen < self._forgets

    def sees(self, now: Time) -> bool:
        """Return whether external vision was used within the last half second."""
        return self._vision is not None and now - self._vision < NS // 2

    def is_settled(self, now: Time) -> bool:
        return self.imu is not None and now >= SETTLING_TIME_NS

    def add_imu(self, imu: Imu, now: Time) -> None:
        """Propagate the estimate with an IMU sample."""
        self.imu = imu
        self.attitude.add_imu(imu, self._observer.bias if self.sees(now) else None)
        x, y, z = rotate(self.attitude.value, imu.specific_force)
        self.acceleration = (x, y, z - GRAVITY)
        self._observer.add_imu(self.acceleration, imu.dt, now)
        if self._aimed is not None and now - self._aimed > NS:
            self.attitude.lose()

    def see(self, pose: VisionPose, now: Time) -> None:
        """Correct the estimate with external vision."""
        used = self._sources()
        at = self._clock.true_at(pose.time, now)
        if at is None:
            return
        turn = 0.0
        if used.vision_heading and pose.heading is not None:
            turn = 0.0 if self._aimed is None else wrap(pose.heading - self.attitude.heading)
            self.attitude.see(pose.heading)
            self._aimed = now
        if not used.vision:
            return
        off = self._observer.off(pose.position, at)
        if not used.vision_height:
            off = (off[0], off[1], 0.0)
        anew = self._vision is None or pose.resets != self._resets
        self._test(ZERO if anew else off, turn, GATE, now)
        left = self._admitted(off, anew, now)
        if left is not None:
            height = VISION_GAIN if used.vision_height else 0.0
            self._observer.correct(
                left, (VISION_GAIN, VISION_GAIN, height), self._since(self._vision, now)
            )
            self._vision, self._resets = now, pose.resets
            self._height = now if used.vision_height else self._height

    def fix(self, position: Vec3, at: Time, now: Time) -> None:
        """Correct the estimate with a GPS position in the world."""
        used = self._sources()
        if not used.gps or (used.vision and self.sees(now)):
            return
        if self._first_fix is None:
            self._first_fix = (now, position)
        since, zero = self._first_fix
        if (now - since) / NS < self._waits:
            return
        x, y, _ = self._observer.off((position[0] - zero[0], position[1] - zero[1], 0.0), at)
        last, gate = self._fixed, 10.0 * GATE
        self._test(ZERO if last is None else (x, y, 0.0), 0.0, gate, now)
        left = self._admitted((x, y, 0.0), last is None, now, gate)
        if left is not None:
            self._observer.correct(left, (FIX_GAIN, FIX_GAIN, 0.0), self._since(last, now))

    def aim(self, heading: float, now: Time) -> None:
        """Correct the estimate with the compass heading."""
        if self._sources().compass:
            self.attitude.see(heading)
            self._aimed = now

    def press(self, height: float, now: Time) -> None:
        """Correct the estimate with the barometric height, unless another sensor measures the
        height."""
        if self._height is not None and now - self._height < NS:
            self._pressure = (now, self.position[2] - height)
            return
        last, zero = self._pressure or (now, 0.0)
        off = height + zero - self.position[2]
        self._observer.correct((0.0, 0.0, off), (0.0, 0.0, PRESSURE_GAIN), self._since(last, now))
        self._pressure = (now, zero)

    def _test(self, off: Vec3, turn: float, gate: float, now: Time) -> None:
        """Note the innovations of a measurement. off, turn: those of the position, metres, and of
        the heading, radians. gate: the largest accepted one of the position, metres."""
        since, self._tested = (now - self._tested) / NS, now
        share = since / (since + self._averages) if since > 0.0 else 0.0
        ratios = hypot(off[0], off[1]) / gate, off[2] / gate, turn / MAX_TURN
        x, y, z = (
            old + share * (min(ratio * ratio, MAX_SQUARE) - old)
            for old, ratio in zip(self._squares, ratios, strict=True)
        )
        self._squares = (x, y, z)

    def _admitted(self, off: Vec3, anew: bool, now: Time, gate: float = GATE) -> Vec3 | None:
        """Return the offset by which to correct the position; None if the measurement is rejected.
        anew: whether the position jumps to the measurement at once. It also jumps to measurements
        that have been far off for `REJECTION_TIME_NS`."""
        is_far = max(hypot(off[0], off[1]), abs(off[2])) > gate
        if is_far and not anew:
            self._rejecting = now if self._rejecting is None else self._rejecting
            if now - self._rejecting < REJECTION_TIME_NS:
                return None
        if is_far or anew:
            self._observer.shift(off)
            if self._fixed is None:
                self._observer.rest()
            off = ZERO
        self._rejecting, self._fixed = None, now
        return off

    @staticmethod
    def _since(last: Time | None, now: Time) -> float:
        return 0.0 if last is None else (now - last) / NS
