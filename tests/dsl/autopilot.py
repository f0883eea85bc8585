"""A driver of hardware that flies nothing, for the pages of what only hardware shows."""

from __future__ import annotations

import random
from collections.abc import Sequence

from kybflow.errors import DriverError
from kybflow.parts import Driver, Seat, Session, params
from kybflow.signals import CommandKind, MeasurementKind


@params
class AutopilotParams:
    pass


class Autopilot(Driver[AutopilotParams]):
    """It is told attitude and thrust, and tells its IMU and its battery."""

    accepts = frozenset({CommandKind.ATTITUDE_THRUST})
    provides = frozenset({MeasurementKind.IMU, MeasurementKind.BATTERY})

    @classmethod
    def open(cls, seats: Sequence[Seat], generator: random.Random) -> Session:
        raise DriverError("it is only an example")
