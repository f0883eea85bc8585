"""What an emulated autopilot believes of itself: attitude, position, velocity, and for how long it
believes so when it sees nothing any more.

Which sightings it heeds stands in its parameters, as it does on the firmware. Its local frame (ENU
here, NED on the wire) is that of external vision, or begins where GPS was first seen.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from kybflow.core.geometry import GRAVITY, ZERO, Vec3, norm, rotate
from kybflow.core.signals import NS, Imu, Time
from kybflow.drivers.emulated_autopilot.parameters import EmulatedParameters
from kybflow.drivers.emulation.estimation import AttitudeFilter, PositionObserver

SEEN, FIX, PRESSURE = 4.0, 0.7, 1.5
"""Bandwidths of the observer for vision, GPS and the barometer, rad/s."""
GATE = 0.5
"""A sighting further off than this is a mistake, metres."""
STUBBORN: Time = NS
"""How long sightings are taken for mistakes before they are believed."""
SETTLES: Time = NS
"""How long the attitude takes at the start."""


class VisionPose(NamedTuple):
    """A pose from external vision. heading: None where it has none. resets: how often the sender
    says that its position has jumped."""

    time: Time
    position: Vec3
    heading: float | None
    resets: int


class Sources(NamedTuple):
    """What is heeded."""

    vision: bool
    vision_height: bool
    vision_heading: bool
    gps: bool
    compass: bool


class EmulatedEstimator:
    """Pure but for what it remembers; every call carries its time."""

    def __init__(
        self, parameters: EmulatedParameters, sources: Callable[[EmulatedParameters], Sources],
        *, forgets: float, waits: float,
    ) -> None:  # fmt: skip
        self.attitude = AttitudeFilter(0.0)
        self.imu: Imu | None = None
        self.acceleration: Vec3 = ZERO
        self._parameters, self._sources = parameters, sources
        self._forgets, self._waits = forgets, waits
        self._observer = PositionObserver()
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
        """Where GPS was first seen."""
        return None if self._first_fix is None else self._first_fix[1]

    def unseen(self, now: Time) -> float | None:
        """Seconds since the position was last seen; None if it never was."""
        return None if self._fixed is None else (now - self._fixed) / NS

    def has_position(self, now: Time) -> bool:
        unseen = self.unseen(now)
        return unseen is not None and unseen < self._forgets

    def sees(self, now: Time) -> bool:
        """Whether external vision was heeded within half a second."""
        return self._vision is not None and now - self._vision < NS // 2

    def is_settled(self, now: Time) -> bool:
        return self.imu is not None and now >= SETTLES

    def feel(self, imu: Imu, now: Time) -> None:
        """Go on by what the inertial sensors felt."""
        self.imu = imu
        self.attitude.feel(imu)
        x, y, z = rotate(self.attitude.value, imu.specific_force)
        self.acceleration = (x, y, z - GRAVITY)
        self._observer.feel(self.acceleration, imu.dt, now)
        if self._aimed is not None and now - self._aimed > NS:
            self.attitude.lose()

    def see(self, pose: VisionPose, now: Time) -> None:
        """External vision."""
        heeded = self._sources(self._parameters)
        if heeded.vision_heading and pose.heading is not None:
            self.attitude.see(pose.heading)
            self._aimed = now
        if not heeded.vision:
            return
        at = pose.time if 0 <= now - pose.time < NS // 2 else now
        off = self._observer.off(pose.position, at)
        if not heeded.vision_height:
            off = (off[0], off[1], 0.0)
        jumped = self._resets is not None and pose.resets != self._resets
        left = self._admitted(off, jumped or self._vision is None, now)
        if left is not None:
            height = SEEN if heeded.vision_height else 0.0
            self._observer.correct(left, (SEEN, SEEN, height), self._since(self._vision, now))
            self._vision, self._resets = now, pose.resets
            self._height = now if heeded.vision_height else self._height

    def fix(self, position: Vec3, at: Time, now: Time) -> None:
        """GPS, in the world."""
        heeded = self._sources(self._parameters)
        if not heeded.gps or (heeded.vision and self.sees(now)):
            return
        if self._first_fix is None:
            self._first_fix = (now, position)
        since, zero = self._first_fix
        if (now - since) / NS < self._waits:
            return
        x, y, _ = self._observer.off((position[0] - zero[0], position[1] - zero[1], 0.0), at)
        last = self._fixed
        left = self._admitted((x, y, 0.0), last is None, now, gate=10.0 * GATE)
        if left is not None:
            self._observer.correct(left, (FIX, FIX, 0.0), self._since(last, now))

    def aim(self, heading: float, now: Time) -> None:
        """The compass."""
        if self._sources(self._parameters).compass:
            self.attitude.see(heading)
            self._aimed = now

    def press(self, height: float, now: Time) -> None:
        """The barometer; it counts where the height isn't seen otherwise."""
        if self._height is not None and now - self._height < NS:
            self._pressure = (now, self.position[2] - height)
            return
        last, zero = self._pressure or (now, 0.0)
        off = height + zero - self.position[2]
        self._observer.correct((0.0, 0.0, off), (0.0, 0.0, PRESSURE), self._since(last, now))
        self._pressure = (now, zero)

    def _admitted(self, off: Vec3, anew: bool, now: Time, gate: float = GATE) -> Vec3 | None:
        """What is left of a sighting that is believed, None where it is not. One that is `anew` is
        gone to at once, and so is one that keeps being far off."""
        is_far = norm(off) > gate
        if is_far and not anew:
            self._rejecting = now if self._rejecting is None else self._rejecting
            if now - self._rejecting < STUBBORN:
                return None
        if is_far or anew:
            self._observer.jump(off)
            if self._fixed is None:
                self._observer.rest()
            off = ZERO
        self._rejecting, self._fixed = None, now
        return off

    @staticmethod
    def _since(last: Time | None, now: Time) -> float:
        return 0.0 if last is None else (now - last) / NS
