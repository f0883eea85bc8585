"""Release the payload, once, while the vehicle holds its position.

In the air it first comes to rest, as `hover` does. Then it requests the servo that holds the
payload to open, in every tick until the vehicle has acknowledged it. It holds its position for
`settle`, because the vehicle has just become lighter, and is done. On the ground the rotors rest.

A payload that was released is not released again: if this behavior is entered again, after it was
done or interrupted, it emits `payload_already_released` and is done at once, until `load_payload`
has loaded a new payload. If the vehicle had not acknowledged the release before an interruption,
the release is requested again; an open servo stays open.

Fails if the release is not acknowledged within `patience`, if no payload is on board, or if the
vehicle refuses.
"""

from __future__ import annotations

from math import inf

from kybflow.core.signals import Done, Failed, Grip, PayloadState, Setpoint, SetpointKind, Tick
from kybflow.core.units import Duration, Vec3
from kybflow.flight.motion import IDLE, Coast
from kybflow.parts import AIR, GROUND, Behavior, Entry, Footprint, param, params


@params
class ReleasePayloadParams:
    patience: Duration = param(
        "Time without an acknowledgement after which the behavior fails.", default=3.0, above=0.0
    )
    settle: Duration = param(
        "Time that the vehicle then holds its position in the air.", default=1.0, at_least=0.0
    )


class ReleasePayload(
    Behavior[ReleasePayloadParams],
    flight=(AIR >> AIR, GROUND >> GROUND),
    emits=SetpointKind.POSITION,
):
    grips = True

    def __init__(self, params: ReleasePayloadParams, entry: Entry) -> None:
        super().__init__(params, entry)
        self._heading = entry.heading
        self._coast = None if entry.flight is GROUND else Coast.after(entry.motion)
        self._asked: float | None = None
        self._released: float | None = None

    def update(self, tick: Tick) -> Setpoint | Grip | Done | Failed:
        time, setpoint = tick.elapsed, IDLE
        if self._coast is not None:
            setpoint = self._coast.at(time).setpoint(self._heading)
            if time < self._coast.duration:
                return setpoint
        first = self._asked is None
        if self._asked is None:
            self._asked = time
        if tick.payload is PayloadState.ABSENT:
            return Failed(setpoint, "no payload is on board")
        if tick.payload is PayloadState.RELEASED:
            if first:  # it was before: the vehicle is not asked again, and an event says so
                self._released = -inf
                return Grip(setpoint, True)
            if self._released is None:
                self._released = time
            settle = 0.0 if self._coast is None else self.params.settle
            return Done(setpoint) if time - self._released >= settle else setpoint
        if time - self._asked > self.params.patience:
            limit = self.params.patience
            return Failed(setpoint, f"the release was not acknowledged within {limit:g} s")
        return Grip(setpoint, True)

    @classmethod
    def footprint(cls, params: ReleasePayloadParams, entry: Vec3 | None) -> Footprint | None:
        longest = params.patience + params.settle
        return Footprint(() if entry is None else (entry,), 0.0, entry, longest=longest)
