"""Sensors beside the vehicle's driver: a camera, motion capture on the network."""

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
        more than 5 ms later than `now` is discarded and reported. Raises DriverError."""

    def trouble(self) -> str | None:
        """Return why nothing can arrive, in words for a person; None if no problem is known."""
        return None

    @abstractmethod
    def close(self) -> None:
        """Release the device or the connection."""


class Sensor(Part[P]):
    """Provides measurements that the vehicle's driver doesn't. provides: their kinds. simulated: it
    observes a simulator's truth, and works with no other vehicle. tracks_bodies: it is of a system
    that tracks other bodies beside its vehicle, and has parameters for their `tracking`."""

    kind = "sensors"
    provides: ClassVar[frozenset[MeasurementKind]]
    simulated: ClassVar[bool] = False
    tracks_bodies: ClassVar[bool] = False

    @classmethod
    def seen_by(cls, params: P, cameras: Mapping[str, Camera]) -> Mapping[str, Camera]:
        """Return the vehicle's cameras on this target, by name: the airframe's, with what the
        sensor knows better, such as a calibration."""
        return cameras

    @classmethod
    def objection(cls, params: P, cameras: Mapping[str, Camera]) -> Objection | None:
        """Return why it can't work with these parameters and cameras, None if it can."""
        return None

    @classmethod
    def claims(cls, params: P, cameras: Mapping[str, Camera]) -> Sequence[str]:
        """Return, in words, what no other sensor of the vehicle may provide; they would be
        indistinguishable."""
        return [f"`{kind_name(kind)}` measurements" for kind in cls.provides]

    @classmethod
    def claim(cls, params: P, vehicle: str) -> Claim | None:
        """Return what no other vehicle's sensor may have; None if there is nothing."""
        return None

    @classmethod
    def tracking(cls, params: P, body: str) -> P:
        """Return the parameters with which it gives the poses of another body. Called of those that
        track bodies."""
        raise NotImplementedError

    @classmethod
    def real_time(cls, params: P) -> bool:
        """Return whether it runs in real time, so that a simulation beside it must too."""
        return False

    @classmethod
    @abstractmethod
    def open(
        cls, params: P, context: VehicleContext, link: Link, generator: random.Random
    ) -> Stream:
        """Open the sensor for the vehicle of `context`, whose driver's link is `link`; all
        randomness comes from `generator`. Raises DriverError."""


def frames_of(cameras: Iterable[str]) -> Sequence[str]:
    """Return what a sensor claims, in words, that takes these cameras' frames."""
    return [f"frames of `{camera}`" for camera in cameras]
