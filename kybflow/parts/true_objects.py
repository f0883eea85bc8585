"""The true states of the world's objects, which only a simulator knows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from kybflow.core.geometry import ZERO, heading_of, rotate_back
from kybflow.core.signals import Time, Truth
from kybflow.parts.driver import Session
from kybflow.parts.fault import ActiveFaults
from kybflow.world.objects import ObjectState, Placement, WorldObject, placements


class TrueObjects:
    """The true states of objects. Without a simulator in which they move, they stay where they
    start. faults: those of every object that can have some, by name."""

    def __init__(self, objects: Mapping[str, WorldObject], sessions: Sequence[Session]) -> None:
        scenes = (session.scene for session in sessions if session.scene is not None)
        self._scene = next(scenes, None) if objects else None
        self.faults: Mapping[str, ActiveFaults] = (
            {} if self._scene is None else self._scene.faults()
        )
        self._at_start = {
            name: ObjectState(place.position, place.attitude, ZERO, _coordinate(one, place), 0.0)
            for name, place in placements(objects, {}).items()
            for one in (objects[name],)
        }

    @property
    def is_known(self) -> bool:
        """Whether a simulator knows them."""
        return self._scene is not None

    @property
    def states(self) -> Mapping[str, ObjectState]:
        """The state of every object now, by name."""
        return self._at_start if self._scene is None else self._scene.states()

    def truth_of(self, name: str) -> Callable[[Time], Truth]:
        """Return a function that returns the true state of an object, for simulated sensors."""

        def truth(_: Time) -> Truth:
            state = self.states[name]
            rates = rotate_back(state.attitude, state.turning)
            return Truth(state.position, state.velocity, state.attitude, rates)

        return truth


def _coordinate(one: WorldObject, place: Placement) -> float:
    return heading_of(place.attitude) if one.joint is None else one.joint.start
