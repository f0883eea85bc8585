"""Sensors that are no part of the vehicle's driver: a camera, motion capture on the network."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, ClassVar

from kybflow.core.signals import Measurement, MeasurementKind, Time, kind_name
from kybflow.parts.base import Objection, P, Part
from kybflow.parts.link import Link
from kybflow.world.cameras import Camera
from kybflow.world.vehicle_context import VehicleContext

if TYPE_CHECKING:
    import random


class Stream(ABC):
    """What a sensor has open for one vehicle. The engine reads it once a tick."""

    @abstractmethod
    def read(self, now: Time) -> Sequence[Measurement]:
        """The measurements that arrived since the last call, oldest first. One that is later than
        `now` by more than 5 ms is left out, and told. Raises DriverError."""

    def trouble(self) -> str | None:
        """Why nothing can come, in words for a person; None where nothing is known to be wrong."""
        return None

    @abstractmethod
    def close(self) -> None: ...


class Sensor(Part[P]):
    """Gives a vehicle measurements that its driver doesn't. `provides` kinds of them. A `simulated`
    one watches a simulated vehicle, and flies with no other."""

    kind = "sensors"
    provides: ClassVar[frozenset[MeasurementKind]]
    simulated: ClassVar[bool] = False

    @classmethod
    def seen_by(cls, params: P, cameras: Mapping[str, Camera]) -> Mapping[str, Camera]:
        """The vehicle's cameras, by name, as they are on this target: those of the airframe, but
        for what the sensor knows better."""
        return cameras

    @classmethod
    def objection(cls, params: P, cameras: Mapping[str, Camera]) -> Objection | None:
        """Why it can't work as it is told on a vehicle with these cameras, None when it can."""
        return None

    @classmethod
    def claims(cls, params: P, cameras: Mapping[str, Camera]) -> Sequence[str]:
        """What no other sensor of the vehicle may give, in words; nobody could tell them apart."""
        return [f"`{kind_name(kind)}` measurements" for kind in cls.provides]

    @classmethod
    def real_time(cls, params: P) -> bool:
        """Whether it goes by the wall's clock, so that a simulation beside it must too."""
        return False

    @classmethod
    @abstractmethod
    def open(
        cls, params: P, context: VehicleContext, link: Link, generator: random.Random
    ) -> Stream:
        """Open it for the vehicle of `context`, whose driver's link is `link`; `generator` is
        the only source of chance. Raises DriverError."""


def frames_of(cameras: Iterable[str]) -> Sequence[str]:
    """What a sensor claims that takes the frames of these cameras."""
    return [f"frames of `{camera}`" for camera in cameras]
