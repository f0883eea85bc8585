"""Wait on the ground, rotors at rest, until the payload is on board.

It closes the servo that holds the payload, and is done when the vehicle reports the payload on
board. A vehicle that can't report it closes the servo and waits for a person to confirm it, as with
`next: [{event: operator.loaded, go: up}]`. From then on the payload may be released again. In
simulation the payload is loaded when the servo closes.
"""

from __future__ import annotations

from kybflow.core.signals import Done, Grip, PayloadState, SetpointKind, Tick
from kybflow.core.units import Vec3
from kybflow.flight.motion import IDLE
from kybflow.parts import GROUND, Behavior, Footprint, params


@params
class LoadPayloadParams:
    """No parameters."""


class LoadPayload(
    Behavior[LoadPayloadParams],
    flight=GROUND >> GROUND,
    emits=SetpointKind.IDLE,
    needs_estimate=False,
):
    grips = True

    def update(self, tick: Tick) -> Grip | Done:
        if tick.payload is PayloadState.ABOARD:
            return Done(IDLE)
        return Grip(IDLE, False)

    @classmethod
    def footprint(cls, params: LoadPayloadParams, entry: Vec3 | None) -> Footprint | None:
        return Footprint(() if entry is None else (entry,), 0.0, entry)
