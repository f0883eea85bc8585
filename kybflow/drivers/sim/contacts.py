"""What the vehicles of a world run into: each other, obstacles and parcels. The floor and stands
are for standing on, and so is the top of an obstacle or a parcel."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from kybflow.core.signals import NS, Time
from kybflow.drivers.sim.model import FIRST_BODY, OBSTACLE, PARCEL

FORGOTTEN: Time = NS // 2
"""After so long without touching, the next touch is another collision."""


UPRIGHT = 0.8
"""A contact that pushes upward so far is one to stand on."""


class Contacts:
    """Finds collisions in MuJoCo's contacts; `vehicles` are the names in order of their bodies."""

    def __init__(self, model: Any, vehicles: Sequence[str]) -> None:
        self._vehicles = vehicles
        self._bodies: list[int] = model.geom_bodyid.tolist()
        names = [model.geom(number).name for number in range(model.ngeom)]
        self._names = [_told(name) for name in names]
        self._beyond = FIRST_BODY + len(vehicles)
        self._matters = [
            body >= FIRST_BODY or name != ""
            for body, name in zip(self._bodies, self._names, strict=True)
        ]
        self._touched: dict[tuple[int, str], Time] = {}
        self._new: list[list[str]] = [[] for _ in vehicles]

    def look(self, data: Any, now: Time) -> None:
        """Note who touches what at `now`."""
        matters, contact = self._matters, data.contact
        for (first, second), frame in zip(contact.geom.tolist(), contact.frame, strict=True):
            if matters[first] and matters[second]:
                up = float(frame[2])  # of the normal, which points from the first to the second
                self._note(self._bodies[first], second, -up, now)
                self._note(self._bodies[second], first, up, now)

    def _note(self, body: int, geom: int, up: float, now: Time) -> None:
        """A body touches a geom, which pushes it upward by the part `up` of its force."""
        if not FIRST_BODY <= body < self._beyond:
            return
        vehicle, other = body - FIRST_BODY, self._bodies[geom]
        is_vehicle = FIRST_BODY <= other < self._beyond
        if not is_vehicle and up > UPRIGHT:
            return
        name = self._vehicles[other - FIRST_BODY] if is_vehicle else self._names[geom]
        if not name:
            return
        last = self._touched.get((vehicle, name))
        if last is None or now - last > FORGOTTEN:
            self._new[vehicle].append(name)
        self._touched[vehicle, name] = now

    def told(self, vehicle: int) -> Sequence[str]:
        """What a vehicle ran into since the last call."""
        new = self._new[vehicle]
        if not new:
            return ()
        self._new[vehicle] = []
        return new


def _told(geom: str) -> str:
    """What a geom is called where it is told; empty for what may be stood on."""
    if geom.startswith(PARCEL):
        return f"the payload of {geom.removeprefix(PARCEL)}"
    return geom.removeprefix(OBSTACLE) if geom.startswith(OBSTACLE) else ""
