"""What is wrong with what a vehicle's cameras show, by the poses that were found in their frames.

lost: frames arrive in the air, and for longer than

    max(BLIND, 2.5 / rate),   rate = frames a second of the fastest camera

no pose was found in them. jumped: a pose is further than

    NEAR + 4 s + 4 p

from where the vehicle believed to be when the frame was taken (s: the estimate's spread, p: the
pose's standard deviation), and the next poses go on from there; a single one is an error, and no
finding. The estimate had not seen the frame then: in most vehicles it is what the IMU predicts. So
it looks when a camera was knocked aside, and when the floor was. swapped: the same, and the pose is
within that of where another vehicle believed to be.

found: poses are found again. recovered: of a camera that jumped, the poses went back, or were lost
meanwhile, and so many in a row are where the vehicle believes to be. Where an estimator followed
the camera they are not, and it is told of another jump.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from math import sqrt
from typing import TYPE_CHECKING, NamedTuple

from kybflow.core.geometry import Vec3, distance
from kybflow.core.signals import NS, Time
from kybflow.runtime.monitoring.camera_health import RECOVERED, Finding
from kybflow.runtime.monitoring.estimate_history import Whereabouts
from kybflow.world.cameras import Camera

if TYPE_CHECKING:
    from kybflow.vision.locating.fit import Located
    from kybflow.vision.locating.locator import Sighting

TAGS_LOST, TAGS_FOUND = "tags_lost", "tags_found"
JUMPED, SWAPPED = "camera_jumped", "camera_swapped"
BLIND, NEAR = 0.15, 0.2
CONFIRMED = 3
"""Poses that follow one another and make a jump, or its end."""
_AND = ", "
STEP, PACE, MEMORY = 0.15, 4.0, 0.25
"""Two poses follow one another that are as near as metres plus m/s, for so many seconds at most."""


class Place(NamedTuple):
    """A pose that was found. bound: how far off it might be, value: how far it is."""

    time: Time
    position: Vec3
    value: float
    bound: float

    def follows(self, last: Place) -> bool:
        """Whether the body of `last` can be here."""
        t = min((self.time - last.time) / NS, MEMORY)
        return distance(self.position, last.position) <= STEP + PACE * t


class Sights:
    """What one vehicle's cameras show. wrong: what was told last of each camera, with the other
    vehicle, as long as it goes on. lost: whether tags are. is_blind: whether no pose was found in
    the newest frames."""

    def __init__(self, vehicle: str, cameras: Mapping[str, Camera], fleet: Whereabouts) -> None:
        self._vehicle, self._fleet = vehicle, fleet
        self._endurance = max(BLIND, 2.5 / max((c.rate for c in cameras.values()), default=30.0))
        self._posed: Time | None = None
        self._tracks: dict[str, _Track] = {}
        self.lost = self.is_blind = False

    @property
    def wrong(self) -> dict[str, Finding]:
        return {name: t.wrong for name, t in self._tracks.items() if t.wrong is not None}

    def judge(self, sighting: Sighting, in_air: bool) -> list[Finding]:
        """What is found with a new sighting. in_air: whether the vehicle is."""
        time, located = sighting.frames[0].time, sighting.located
        self.is_blind = located is None
        if located is None:
            return self._blind(time, in_air)
        self._posed = time
        findings: list[Finding] = []
        if self.lost:
            self.lost = False
            findings.append(Finding(TAGS_FOUND))
        if not in_air:  # it may be carried about
            self._tracks.clear()
            return findings
        place = self._placed(time, located)
        if place is not None:
            camera = _names(located)
            track = self._tracks.setdefault(camera, _Track(self._endurance))
            findings += track.follow(place, camera, self._whose)
            if place.value <= place.bound:
                findings += self._agreed(camera)
        return findings

    def _agreed(self, cameras: str) -> Iterator[Finding]:
        """Cameras that told a good pose together: what each did wrong alone is over."""
        for name, track in self._tracks.items():
            if name != cameras and name in cameras.split(_AND) and track.agrees():
                yield Finding(RECOVERED, name)

    def _blind(self, time: Time, in_air: bool) -> list[Finding]:
        if self._posed is None or not in_air:
            self._posed = time
            return []
        since = (time - self._posed) / NS
        if since <= self._endurance or self.lost:
            return []
        self.lost = True
        return [Finding(TAGS_LOST, "", since, self._endurance)]

    def _placed(self, time: Time, located: Located) -> Place | None:
        believed = self._fleet.at(self._vehicle, time)
        if believed is None:
            return None
        off = distance(located.position, believed.position)
        deviation = sqrt(max(0.0, *located.covariance.diagonal()[:3].tolist()))
        return Place(time, located.position, off, NEAR + 4.0 * (believed.spread + deviation))

    def _whose(self, place: Place) -> str:
        """The other vehicle that believed to be where `place` is, the nearest one; empty when none
        did."""
        best, whose = 1.0, ""
        for other, believed in self._fleet.others(self._vehicle, place.time):
            share = distance(place.position, believed.position) / (NEAR + 4.0 * believed.spread)
            if share < best:
                best, whose = share, other
        return whose


class _Track:
    """The poses of one camera, or of several that told them together. elsewhere: those that may
    become a jump. good: since they went back, or came again after `endurance` seconds."""

    def __init__(self, endurance: float) -> None:
        self._endurance = round(endurance * NS)
        self.wrong: Finding | None = None
        self._last: Place | None = None
        self._elsewhere: list[Place] = []
        self._good = 0

    def agrees(self) -> bool:
        """Whether another good pose that it had a part in ends what was wrong."""
        self._good += 1
        if self.wrong is None or self._good < CONFIRMED:
            return False
        self.wrong = None
        return True

    def follow(self, place: Place, camera: str, whose: Callable[[Place], str]) -> Iterator[Finding]:
        """What is found with the next one. whose: the vehicle that is there."""
        last, self._last = self._last, place
        went = last is not None and (
            place.time - last.time > self._endurance or not place.follows(last)
        )
        is_off = place.value > place.bound
        if went:
            self._elsewhere.clear()
            self._good = 0
        if self.wrong is not None and not is_off and (went or self._good):
            self._good += 1
            if self._good >= CONFIRMED:
                self.wrong = None
                yield Finding(RECOVERED, camera)
            return
        if self._elsewhere or (is_off and (went or self.wrong is None)):
            self._elsewhere.append(place)
        if len(self._elsewhere) >= CONFIRMED:
            first, *_ = self._elsewhere
            self._elsewhere.clear()
            other = whose(first)
            event = SWAPPED if other else JUMPED
            self.wrong = Finding(event, camera, first.value, first.bound, other)
            yield self.wrong


def _names(located: Located) -> str:
    """The cameras whose frames told it."""
    names = (view.camera.name for view in located.views if len(view.tags))
    return _AND.join(dict.fromkeys(names))
