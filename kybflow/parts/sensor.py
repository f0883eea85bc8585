"""Sensors that don't belong to the vehicle's driver, such as a camera or motion capture on the
network."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, ClassVar

from kybflow.core.signals import Measurement, MeasurementKind, Time, kind_name
from kybflow.parts.base import Claim, Objection, P, Part
from kybflow.parts.link import Link
from kybflow.world.cameras import Camera
from kybflow.world.vehicle_context import VehicleContext

if TYPE_CHECKING:
    import random


class Stream(ABC):
    """An open sensor of one vehicle. The engine reads it once a tick."""

    @abstractmethod
    def read(self, now: Time) -> Sequence[Measurement]:
        """Return the measurements that arrived since the last call, oldest first. A measurement
        whose time is more than 5 ms after `now` is discarded and reported. Raises DriverError."""

    def trouble(self) -> str | None:
        """Return a human-readable reason why nothing can arrive, or None if no problem is known."""
        return None

    @abstractmethod
    def close(self) -> None:
        """Release the device or the connection."""


class Sensor(Part[P]):
    """Provides measurements that the vehicle's driver doesn't. provides: their kinds. simulated:
    whether it observes a simulator's truth, so that it works only with simulated vehicles.
    tracks_bodies: whether its system also tracks other bodies, for which `tracking` returns
    parameters."""

    kind = "sensors"
    provides: ClassVar[frozenset[MeasurementKind]]
    simulated: ClassVar[bool] = False
    tracks_bodies: ClassVar[bool] = False

    @classmethod
    def seen_by(cls, params: P, cameras: Mapping[str, Camera]) -> Mapping[str, Camera]:
        """Return the vehicle's cameras on this target, by name: those of the airframe, with any
        better data that the sensor has, such as a calibration."""
        return cameras

    @classmethod
    def objection(cls, params: P, cameras: Mapping[str, Camera]) -> Objection | None:
        """Return why the sensor can't work with these parameters and cameras, or None if it can."""
        return None

    @classmethod
    def claims(cls, params: P, cameras: Mapping[str, Camera]) -> Sequence[str]:
        """Return descriptions of what no other sensor of the vehicle may provide, because the
        measurements would be indistinguishable."""
        return [f"`{kind_name(kind)}` measurements" for kind in cls.provides]

    @classmethod
    def claim(cls, params: P, vehicle: str) -> Claim | None:
        """Return what this sensor uses that no other vehicle's sensor may use, None if there is
        nothing."""
        return None

    @classmethod
    def tracking(cls, params: P, body: str) -> P:
        """Return the parameters with which the sensor provides the poses of another body. Called
        only if it `tracks_bodies`."""
        raise NotImplementedError

    @classmethod
    def real_time(cls, params: P) -> bool:
        """Return whether the sensor runs in real time, so that a simulation with it must too."""
        return False

    @classmethod
    @abstractmethod
    def open(
        cls, params: P, context: VehicleContext, link: Link, generator: random.Random
    ) -> Stream:
        """Open the sensor for the vehicle of `context`. link: the link of the vehicle's driver. All
        randomness comes from `generator`. Raises DriverError."""


def frames_of(cameras: Iterable[str]) -> Sequence[str]:
    """Return the `claims` of a sensor that takes the frames of these cameras."""
    return [f"frames of `{camera}`" for camera in cameras]
