"""What the vehicles of a world touch: each other, obstacles, parcels, stands and the floor."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from kybflow.core.signals import NS, Time
from kybflow.drivers.sim.model import FIRST_BODY, FLOOR, OBSTACLE, PARCEL
from kybflow.parts.link import Touch

FORGOTTEN: Time = NS // 2
"""After so long without touching, the next contact is another touch."""
UPRIGHT = 0.8
"""A contact that pushes upward so far is one to stand on."""


class Contacts:
    """Finds touches in MuJoCo's contacts; `vehicles` are the names in order of their bodies."""

    def __init__(self, model: Any, vehicles: Sequence[str]) -> None:
        bodies: list[int] = model.geom_bodyid.tolist()
        beyond = FIRST_BODY + len(vehicles)
        self._vehicles = {
            geom: body - FIRST_BODY
            for geom, body in enumerate(bodies)
            if FIRST_BODY <= body < beyond
        }
        named = (model.geom(number).name for number in range(model.ngeom))
        self._names = [
            _told(name or model.body(body).name) for name, body in zip(named, bodies, strict=True)
        ]
        for geom, index in self._vehicles.items():
            self._names[geom] = vehicles[index]
        self._touched: dict[tuple[int, str, bool], Time] = {}

    def begun(self, data: Any, now: Time) -> list[tuple[int, Touch]]:
        """Return each vehicle that begins to touch something at `now`, with what it touches."""
        vehicles, contact = self._vehicles, data.contact
        found: list[tuple[int, Touch]] = []
        for (first, second), frame in zip(contact.geom.tolist(), contact.frame, strict=True):
            up = float(frame[2])  # of the normal, which points from the first to the second
            if first in vehicles:
                self._note(vehicles[first], second, -up, now, found)
            if second in vehicles:
                self._note(vehicles[second], first, up, now, found)
        return found

    def _note(
        self, vehicle: int, geom: int, up: float, now: Time, found: list[tuple[int, Touch]]
    ) -> None:
        """A vehicle touches a geom, which pushes it upward by the part `up` of its force. Another
        vehicle carries nobody."""
        touch = Touch(self._names[geom], up > UPRIGHT and geom not in self._vehicles)
        last = self._touched.get((vehicle, *touch))
        self._touched[vehicle, *touch] = now
        if last is None or now - last > FORGOTTEN:
            found.append((vehicle, touch))


def _told(geom: str) -> str:
    """What a geom that is no vehicle's is called where it is told."""
    if geom.startswith(PARCEL):
        return f"the payload of {geom.removeprefix(PARCEL)}"
    if geom.startswith(OBSTACLE):
        return geom.removeprefix(OBSTACLE)
    return "the floor" if geom == FLOOR else "a stand"
