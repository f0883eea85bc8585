"""Emulated AR.Drones on simulated quadrotors, for tests, rehearsals and any client.

The vehicles are those of `sim`, in one MuJoCo world. Each carries an emulation of the drone's
computer: AT commands, navigation data, configuration, watchdogs, and its own take-off, hovering and
landing. The driver for real drones flies them, in memory and in lockstep with the engine's clock,
or with `network` over the loopback addresses 127.0.0.2, 127.0.0.3 and so on. Foreign clients are
tested against the emulation, but it doesn't predict how a real drone flies.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, ClassVar

from kybflow.core.signals import Pose
from kybflow.core.units import Duration, Ratio
from kybflow.drivers.ardrone import CLIMB_TIME, Ardrone
from kybflow.drivers.ardrone.params import ArdroneLinkParams
from kybflow.drivers.sim import Sim, SimParams
from kybflow.parts import Air, Driver, Seat, Session, param, params
from kybflow.world.vehicle_context import Airframe, InnerLoop

if TYPE_CHECKING:
    import random


@params
class EmulatedArdroneParams(ArdroneLinkParams, SimParams):
    wifi_latency: Duration = param(
        "Delay of the radio link, each way.",
        default=0.015, at_least=0.0, at_most=0.5, read_only=True,
    )  # fmt: skip
    wifi_jitter: Duration = param(
        "Largest deviation from that delay, uniformly distributed.",
        default=0.01, at_least=0.0, at_most=0.2, read_only=True,
    )  # fmt: skip
    wifi_loss: Ratio = param(
        "Share of datagrams that are lost.", default=0.01, at_least=0.0, at_most=0.9, read_only=True
    )
    network: bool = param(
        "Use sockets on loopback addresses, in real time, instead of memory.",
        default=False, read_only=True,
    )  # fmt: skip


class EmulatedArdrone(Driver[EmulatedArdroneParams]):
    accepts = Ardrone.accepts
    provides = Ardrone.provides | {Pose}
    acts = Ardrone.acts
    simulated: ClassVar[bool] = True
    moves_objects: ClassVar[bool] = True
    lands: ClassVar[bool] = True
    lands_blind: ClassVar[bool] = True
    brings = ("simulated_camera",)
    preflight_timeout = Ardrone.preflight_timeout
    caps: ClassVar[Mapping[str, str]] = Ardrone.caps
    bodies: ClassVar[Mapping[str, tuple[float, float]]] = Ardrone.bodies
    targets: ClassVar[Mapping[str, Mapping[str, str | bool]]] = {"emulated_ardrone": {}}

    @classmethod
    def tracker(cls, params: EmulatedArdroneParams) -> Mapping[str, str]:
        return Ardrone.tracker(params)

    @classmethod
    def control_rate(cls, params: EmulatedArdroneParams) -> int:
        return Ardrone.control_rate(params)

    @classmethod
    def real_time(cls, params: EmulatedArdroneParams) -> bool:
        return params.network

    @classmethod
    def world(cls, params: EmulatedArdroneParams) -> str:
        return f"{Sim.world(params)}, as emulated AR.Drones"

    @classmethod
    def air(cls, params: EmulatedArdroneParams) -> Air:
        return Sim.air(params)

    @classmethod
    def inner_loop(cls, params: EmulatedArdroneParams, airframe: Airframe) -> InnerLoop:
        own, radio = Sim.inner_loop(params, airframe), Ardrone.inner_loop(params, airframe)
        late = own.command_latency + radio.command_latency
        return own._replace(command_latency=late, climb_time=CLIMB_TIME)

    @classmethod
    def step_rate(cls, params: EmulatedArdroneParams) -> float | None:
        return params.physics

    @classmethod
    def open(cls, seats: Sequence[Seat], generator: random.Random) -> Session:
        from kybflow.drivers.emulated_ardrone.session import EmulatedDroneSession

        return EmulatedDroneSession(seats, generator)
