"""Steer with a device that pushes back: the hand feels the vehicle and what is in its way.

The position of the hand, over `reach`, is the axes `x`, `y` and `z` (`turn` stays at zero); the
buttons are `button0` to `button3`. The force is

    f = force p - spring x - damping v,

p being what the steered behavior lets the hand feel: how much slower or faster the vehicle is than
asked, as a share of its speed, and the way out of what it comes near to. It is no longer than
`most`, and passive: the device gives out no more energy than the hand put in and 0.05 J
(`kybflow.inputs.haptics`). TeleKyb had f = -20 x - 5 v + 100 (mean velocity - asked / 5), with
nothing that kept it passive. `force_x`, `force_y` and `force_z` tell the force as shares of `most`,
as axes, so that the report shows it.

`device: force_dimension` is an omega, delta, sigma or lambda (`pip install 'kybflow[haptics]'` and
the maker's SDK); `simulated` is a hand that follows the script `hand`.
"""

from __future__ import annotations

from typing import Literal

from kybflow.core.files import File
from kybflow.core.geometry import ZERO, Vec3, add, scale
from kybflow.core.signals import NS, InputReading, Time
from kybflow.core.units import Force, Length, Ratio
from kybflow.flight.governor import shortened
from kybflow.inputs.deflection import beyond
from kybflow.inputs.haptics import (
    EnergyTank,
    ForceDimension,
    HapticDevice,
    HapticState,
    SimulatedHand,
)
from kybflow.inputs.script import read_rows
from kybflow.parts import AXES, Input, InputLink, param, params
from kybflow.parts.base import Objection
from kybflow.parts.input import FeltLink, SticksOf

_FORCES = ("force_x", "force_y", "force_z")


@params
class HapticParams:
    device: Literal["force_dimension", "simulated"] = param(
        "What the hand moves.", default="force_dimension", read_only=True
    )
    hand: File | None = param(
        "Where the simulated hand goes.", default=None, read_only=True, reads=read_rows
    )
    reach: Length = param("How far a full deflection is.", default=0.05, above=0.0)
    dead_zone: Ratio = param(
        "Deflection that counts as none.", default=0.1, at_least=0.0, at_most=0.5
    )
    force: Force = param("Force of a whole mismatch.", default=4.0, at_least=0.0)
    spring: Force = param("Force to the centre at `reach`.", default=2.0, at_least=0.0)
    damping: Force = param("Force against a hand of 1 m/s.", default=4.0, at_least=0.0)
    most: Force = param("Largest force.", default=8.0, above=0.0)


class Haptic(Input[HapticParams]):
    stuck_after = None
    packages = ("forcedimension-core",)

    @classmethod
    def real_time(cls, params: HapticParams) -> bool:
        return params.device != "simulated"

    @classmethod
    def axes(cls, params: HapticParams) -> tuple[str, ...]:
        return (*AXES, *_FORCES)

    @classmethod
    def buttons(cls, params: HapticParams) -> tuple[str, ...]:
        scripted = () if params.hand is None else read_rows(params.hand).buttons
        return tuple(dict.fromkeys((*(f"button{i}" for i in range(4)), *scripted)))

    @classmethod
    def objection(cls, params: HapticParams) -> Objection | None:
        if params.device == "simulated" and params.hand is None:
            return Objection("device", "a simulated hand needs a script", "write `hand: hand.csv`")
        return None

    @classmethod
    def open(cls, params: HapticParams, sticks_of: SticksOf) -> InputLink:
        if params.device == "simulated" and params.hand is not None:
            return HapticLink(params, SimulatedHand(read_rows(params.hand).rows, params.reach))
        return HapticLink(params, ForceDimension())


class HapticLink(FeltLink):
    """Reads a device and pushes back, once a tick each."""

    def __init__(self, params: HapticParams, device: HapticDevice) -> None:
        self._params, self._device = params, device
        self._tank = EnergyTank()
        self._state: HapticState | None = None
        self._read: Time = 0
        self._dt = 0.0
        self._force = ZERO

    def read(self, now: Time) -> InputReading | None:
        self._dt, self._read = (now - self._read) / NS, now
        self._state = state = self._device.read(now)
        x, y, z = (self._deflection(place) for place in state.position)
        felt = scale(self._force, 1.0 / self._params.most)
        values = (x, y, z, 0.0, *felt)
        return InputReading(now, dict(zip((*AXES, *_FORCES), values, strict=True)), state.held)

    def _deflection(self, place: float) -> float:
        share = max(-1.0, min(1.0, place / self._params.reach))
        return beyond(share, self._params.dead_zone)

    def feel(self, push: Vec3) -> None:
        state, p = self._state, self._params
        if state is None:
            return
        wanted = add(scale(push, p.force), scale(state.position, -p.spring / p.reach))
        wanted = add(wanted, scale(state.velocity, -p.damping))
        self._force = self._tank.passed(shortened(wanted, p.most), state, self._dt)
        self._device.feel(self._force)

    def close(self) -> None:
        self._device.close()
