"""PX4 or ArduPilot, emulated on simulated quadrotors: for tests, and for dry runs without firmware.

The vehicles are those of `sim`, in one MuJoCo world. Each has an emulated autopilot whose
estimator, controllers, modes, arming checks and failsafes behave as observed on the firmware. The
MAVLink driver flies it over wires in memory, in lockstep with the engine's clock: the same seed
gives the same flight. By default its parameters are those that flight indoors needs. The emulation
proves nothing about the firmware: fly that in its own simulator.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, ClassVar, Literal

from kybflow.core.signals import Pose
from kybflow.drivers import firmware_names
from kybflow.drivers.mavlink import Mavlink
from kybflow.drivers.mavlink.params import AutopilotLinkParams
from kybflow.drivers.sim import Sim, SimParams
from kybflow.parts import Air, Driver, Seat, Session, param, params
from kybflow.world.vehicle_context import Airframe, InnerLoop

if TYPE_CHECKING:
    import random

    EmulatedName = str
else:
    EmulatedName = Literal[firmware_names("emulated_autopilot")]


@params
class EmulatedAutopilotParams(AutopilotLinkParams, SimParams):
    autopilot: EmulatedName = param("The emulated firmware.", default="px4", read_only=True)
    prepared: bool = param(
        "Whether its parameters are those that kybflow needs, or the firmware's defaults.",
        default=True, read_only=True,
    )  # fmt: skip


class EmulatedAutopilot(Driver[EmulatedAutopilotParams]):
    """The driver; it imports MuJoCo and pymavlink only when it is opened."""

    accepts = Mavlink.accepts
    provides = Mavlink.provides | {Pose}
    streams_imu = Mavlink.streams_imu
    simulated: ClassVar[bool] = True
    moves_objects: ClassVar[bool] = True
    lands: ClassVar[bool] = True
    lands_blind: ClassVar[bool] = True
    grips: ClassVar[bool] = True
    brings = ("simulated_camera",)
    preflight_timeout = Mavlink.preflight_timeout
    targets: ClassVar[Mapping[str, Mapping[str, str | bool]]] = {
        f"emulated_{name}": {"autopilot": name} for name in firmware_names("emulated_autopilot")
    }

    @classmethod
    def tracker(cls, params: EmulatedAutopilotParams) -> Mapping[str, str] | None:
        """Return the default tracker of a real autopilot, without its `keeps_height`: both emulated
        firmwares turn accelerations directly into thrust."""
        asked = Mavlink.tracker(params)
        return {name: value for name, value in asked.items() if name != "keeps_height"}

    @classmethod
    def control_rate(cls, params: EmulatedAutopilotParams) -> int:
        return Mavlink.control_rate(params)

    @classmethod
    def world(cls, params: EmulatedAutopilotParams) -> str:
        return f"{Sim.world(params)}, with an emulated autopilot"

    @classmethod
    def air(cls, params: EmulatedAutopilotParams) -> Air:
        return Sim.air(params)

    @classmethod
    def inner_loop(cls, params: EmulatedAutopilotParams, airframe: Airframe) -> InnerLoop:
        return Sim.inner_loop(params, airframe)

    @classmethod
    def step_rate(cls, params: EmulatedAutopilotParams) -> float | None:
        return params.physics

    @classmethod
    def open(cls, seats: Sequence[Seat], generator: random.Random) -> Session:
        from kybflow.drivers.emulated_autopilot.session import EmulatedSession

        return EmulatedSession(seats, generator)
