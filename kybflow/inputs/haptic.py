"""Steer with a haptic device, whose force shows how the vehicles follow and what is near them.

The position of the hand over `reach` gives the axes `x`, `y` and `z` (`turn` stays at zero); the
buttons are `button0` to `button3`. The force is

    f = force p - spring x - damping v,

where p comes from the steered behavior, as the mean over all steered vehicles: their velocity error
as a fraction of the speed, and the direction away from what is near. The force is at most `most`,
and passive: the device returns no more energy than the hand put in plus 0.05 J
(`kybflow.inputs.haptics`). All but the damping fades within 200 ms when all steered vehicles are
held, the input is lost, or the tick is late. TeleKyb used f = -20 x - 5 v + 100 (mean velocity -
asked / 5), without passivity. The axes `force_x`, `force_y` and `force_z` are the force as
fractions of `most`, for the report.

`device: force_dimension` is an omega, delta, sigma or lambda (`pip install 'kybflow[haptics]'` and
the maker's SDK); `simulated` is a hand that follows the script `hand`.
"""

from __future__ import annotations

from math import isfinite
from typing import Literal

from kybflow.core.files import File
from kybflow.core.geometry import Vec3, add, scale
from kybflow.core.signals import InputReading, Time
from kybflow.core.units import Force, Length, Ratio
from kybflow.flight.governor import shortened
from kybflow.inputs.deflection import deflection
from kybflow.inputs.haptics import (
    SERVO_PERIOD_NS,
    ForceDimension,
    HapticDevice,
    HapticState,
    Servo,
    ServoThread,
    SimulatedHand,
)
from kybflow.inputs.script import read_rows
from kybflow.parts import AXES, Input, InputLink, param, params
from kybflow.parts.base import Objection
from kybflow.parts.input import FeltLink, SticksOf

_FORCES = ("force_x", "force_y", "force_z")
STRONGEST = 20.0
"""The largest force of the strongest device, N: a delta.3 or a sigma.7 by Force Dimension, whose
workspace has a radius of 20 cm. An omega.3 gives 12 N."""


@params
class HapticParams:
    device: Literal["force_dimension", "simulated"] = param(
        "The haptic device.", default="force_dimension", read_only=True
    )
    hand: File | None = param(
        "Script of the simulated hand.", default=None, read_only=True, reads=read_rows
    )
    reach: Length = param(
        "Distance of a full deflection.", default=0.05, at_least=0.005, at_most=0.2
    )
    dead_zone: Ratio = param(
        "Deflection that counts as zero.", default=0.1, at_least=0.0, at_most=0.5
    )
    force: Force = param("Force at a mismatch of 1.", default=4.0, at_least=0.0)
    spring: Force = param("Force to the centre at `reach`.", default=2.0, at_least=0.0)
    damping: Force = param(
        "Damping force at a hand speed of 1 m/s.", default=4.0, at_least=0.0, at_most=40.0
    )
    most: Force = param("Largest force.", default=8.0, above=0.0, at_most=STRONGEST)


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
        p, nothing = params, {"force": "feel the vehicles", "spring": "find the centre"}
        for name, sense in nothing.items():
            value = getattr(p, name)
            if value == 0.0:
                reason = f"a hand can't {sense} with a `{name}` of 0 N"
                return Objection(name, reason, "write more", is_doubt=True)
            if value > p.most:
                reason = f"`{name}` of {value:g} N is cut off at `most`, {p.most:g} N"
                return Objection(name, reason, "write less, or more `most`", is_doubt=True)
        return None

    @classmethod
    def open(cls, params: HapticParams, sticks_of: SticksOf) -> InputLink:
        if params.device == "simulated" and params.hand is not None:
            hand = SimulatedHand(read_rows(params.hand).rows, params.reach)
            return HapticLink(params, hand, threaded=False)
        return HapticLink(params, ForceDimension(), threaded=True)


class HapticLink(FeltLink):
    """Reads the last sample of a servo and passes forces to it. `read` steps the servo of a
    simulated device up to the tick's time; the servo of a real device has its own thread."""

    def __init__(self, params: HapticParams, device: HapticDevice, *, threaded: bool) -> None:
        self._params, self._device = params, device
        self._servo = Servo(device, self._law)
        self._thread = ServoThread(self._servo) if threaded else None
        self._stepped: Time = -SERVO_PERIOD_NS
        self._now: Time = 0

    def read(self, now: Time) -> InputReading | None:
        while self._thread is None and self._stepped + SERVO_PERIOD_NS <= now:
            self._stepped += SERVO_PERIOD_NS
            self._servo.step(self._stepped)
        self._now = now if self._thread is None else self._thread.now()
        last = self._servo.last
        if last is None:
            return None
        held = last.state.held | self._servo.pressed()
        p = self._params
        x, y, z = (  # what isn't finite stays as it is, so that the input counts as lost
            deflection(max(-1.0, min(1.0, at / p.reach)), p.dead_zone) if isfinite(at) else at
            for at in last.state.position
        )
        force = scale(last.force, 1.0 / p.most)
        axes = dict(zip((*AXES, *_FORCES), (x, y, z, 0.0, *force), strict=True))
        return InputReading(now - max(0, self._now - last.at), axes, held)

    def trouble(self) -> str | None:
        return None if self._thread is None else self._thread.trouble

    def apply_force(self, push: Vec3 | None) -> None:
        self._servo.apply_force(push, self._now)

    def _law(self, push: Vec3, state: HapticState, share: float) -> Vec3:
        p = self._params
        wanted = add(scale(push, p.force), scale(state.position, -p.spring / p.reach))
        damped = scale(state.velocity, -p.damping)
        return shortened(add(scale(wanted, share), damped), p.most)

    def close(self) -> None:
        if self._thread is not None:
            self._thread.close()
        self._device.close()
