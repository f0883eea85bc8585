"""Monitors the cameras of a vehicle: their frames, and the poses that are found in the frames.

These findings depend on the times and the images of a camera's frames. lost: no frame for longer
than

    max(SILENCE_S, 3 / rate),   rate = the camera's frames a second

froze: in the air, frames with new times but identical images for longer than

    max(FREEZE_S, 1.5 / rate)

Sensor noise makes two equal images impossible, so comparing some 1,200 pixels of each suffices. An
image of uniform brightness doesn't count as frozen, because the camera may be in the dark or
dazzled. On the ground images may repeat, as those of a simulated sensor without noise do. A camera
is monitored from its first frame on; if there is none, its sensor reports why.

These findings depend on the poses that were found in the frames. tags lost: frames arrive in the
air, and for longer than

    max(BLIND, 2.5 / rate),   rate = frames a second of the fastest camera

no pose was found in them. found: poses are found again. jumped: a pose is further than

    NEAR + 4 s + 4 p

from the vehicle's estimate at the time of the frame (s: the estimate's spread, p: the pose's
standard deviation), and the next poses continue from there; a single such pose is a measurement
error. That estimate did not include the frame yet; in most vehicles it is predicted by the IMU. A
camera that was knocked aside causes a jump, and so does a map of tags that was moved. swapped: the
pose jumped to within that distance of another vehicle's estimate.

recovered: after a loss or a freeze, `AGREEING_POSES` good frames in a row. After a jump, the poses
must have jumped back or been lost for a while, and then as many in a row must agree with the
vehicle's estimate. If an estimator followed the camera, they don't agree, and another jump is
reported."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from math import sqrt
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy

from kybflow.core.events import VehicleEvent
from kybflow.core.geometry import Vec3, distance
from kybflow.core.signals import NEVER, NS, Estimate, Frame, Measurement, Time
from kybflow.dsl.plan import VehiclePlan
from kybflow.flight.pose_gate import Consistent, reach
from kybflow.parts import Estimator
from kybflow.parts.events import (
    CameraFroze,
    CameraJumped,
    CameraLostEvent,
    CameraRecovered,
    CameraSwappedEvent,
    TagsFound,
    TagsLost,
)
from kybflow.runtime.events import Events
from kybflow.runtime.monitoring.bodies import Trouble, nearest
from kybflow.world.cameras import Camera

if TYPE_CHECKING:
    from kybflow.vision.locating.locator import Sighting

_KEPT_ESTIMATES = 512
CURRENT_AGE_NS = NS // 20
"""An estimate counts as the estimate at a given time if it is at most this much older."""


class EstimateHistory:
    """The recent estimates of a fleet. A camera's frame arrives late, so it is compared with the
    estimate from the time when it was taken.

    is_asked: whether a monitor uses the
    history; otherwise nothing is kept, to spare the CPU's caches.
    """

    def __init__(self) -> None:
        self.is_asked = False
        self._kept: dict[str, deque[Estimate]] = {}

    def ask(self) -> None:
        """Keep estimates from now on, because a monitor uses them."""
        self.is_asked = True

    def note(self, vehicle: str, estimate: Estimate) -> None:
        """Keep the newest estimate of a vehicle."""
        kept = self._kept.get(vehicle)
        if kept is None:
            kept = self._kept[vehicle] = deque(maxlen=_KEPT_ESTIMATES)
        kept.append(estimate)

    def at(self, vehicle: str, time: Time) -> Estimate | None:
        """Return the vehicle's estimate at `time` or shortly before, or None."""
        for estimate in reversed(self._kept.get(vehicle, ())):
            if estimate.time <= time:
                return estimate if time - estimate.time <= CURRENT_AGE_NS else None
        return None

    def others(self, vehicle: str, time: Time) -> Iterator[tuple[str, Estimate]]:
        """Yield (name, estimate) of each other vehicle that had an estimate at `time`."""
        for other in self._kept:
            estimate = None if other == vehicle else self.at(other, time)
            if estimate is not None:
                yield other, estimate


SILENCE_S, FREEZE_S = 0.15, 0.1
"""Least times (s) after which a camera is lost, and after which it froze. From 15 Hz on, both are
reported before the estimate is a quarter of a second old."""
_COMPARED_PIXELS = 40
"""Number of pixels of a row that are compared."""
BLIND, NEAR = 0.15, 0.2
_AND = ", "


class CameraStreams:
    """The frames of one vehicle's cameras. due: when the next camera is lost if no frame arrives
    before."""

    def __init__(self, cameras: Mapping[str, Camera]) -> None:
        self._cameras = cameras
        self._streams: dict[str, _CameraStream] = {}
        self.due: Time = NEVER

    @property
    def wrong(self) -> dict[str, VehicleEvent]:
        """The present fault of each camera that has one."""
        found = {name: stream.trouble.finding for name, stream in self._streams.items()}
        return {name: finding for name, finding in found.items() if finding is not None}

    def judge(self, frames: Sequence[Frame], now: Time, airborne: bool) -> list[VehicleEvent]:
        """Judge new frames; return the findings. Must be called whenever frames arrive, and from
        `due` on even without frames."""
        findings: list[VehicleEvent] = []
        for frame in frames:
            stream = self._streams.get(frame.camera)
            if stream is None:
                stream = _CameraStream(frame.camera, self._cameras[frame.camera].rate)
                self._streams[frame.camera] = stream
            findings += stream.judge(frame, now, airborne)
        for stream in self._streams.values():
            findings += stream.miss(now)
        waiting = (s for s in self._streams.values() if not s.trouble.is_known(CameraLostEvent))
        self.due = min((s.last + round(s.timeout * NS) for s in waiting), default=NEVER)
        return findings


class _CameraStream:
    """The frames of one camera. timeout, freeze_timeout: the longest times (s) without a frame and
    without a new image. last: when its last frame arrived."""

    __slots__ = ("_changed", "_name", "_sample", "freeze_timeout", "last", "timeout", "trouble")

    def __init__(self, name: str, rate: float) -> None:
        self._name = name
        self.timeout, self.freeze_timeout = max(SILENCE_S, 3.0 / rate), max(FREEZE_S, 1.5 / rate)
        self.last: Time = 0
        self.trouble = Trouble()
        self._changed: Time = 0
        self._sample: Any = None

    def judge(self, frame: Frame, now: Time, airborne: bool) -> Iterator[VehicleEvent]:
        """Judge a frame that arrived at `now`; yield the findings."""
        self.last, trouble = now, self.trouble
        if self._repeats(frame) and (airborne or trouble.is_known(CameraFroze)):
            since = (frame.time - self._changed) / NS
            bound = self.freeze_timeout
            if since > bound and not trouble.is_known(CameraFroze):
                yield trouble.found(CameraFroze(camera=self._name, value=since, bound=bound))
            trouble.count_anew()
            return
        self._changed = frame.time
        if trouble.is_over():
            yield CameraRecovered(camera=self._name)

    def miss(self, now: Time) -> Iterator[VehicleEvent]:
        """Report the camera as lost if no frame has arrived for too long."""
        silence = (now - self.last) / NS
        if silence > self.timeout and not self.trouble.is_known(CameraLostEvent):
            self.trouble.count_anew()
            lost = CameraLostEvent(camera=self._name, value=silence, bound=self.timeout)
            yield self.trouble.found(lost)

    def _repeats(self, frame: Frame) -> bool:
        """Remember a frame's image; return whether it repeats the previous one."""
        step = max(1, frame.image.shape[1] // _COMPARED_PIXELS)
        sample, last = frame.image[::step, ::step], self._sample
        if last is None or not numpy.array_equal(sample, last):
            self._sample = sample.copy()  # the next image may be written over this one
            return False
        return bool(sample.min() != sample.max())


class _Place(NamedTuple):
    """The position (world, m) at which a camera's frames show the vehicle. value: its distance from
    the estimate (m). bound: the largest plausible distance (m)."""

    time: Time
    position: Vec3
    value: float
    bound: float

    def follows(self, last: _Place) -> bool:
        """Return whether a vehicle can have flown here from `last`."""
        return distance(self.position, last.position) <= reach((self.time - last.time) / NS)


class Sightings:
    """The poses of a vehicle that were found in its cameras' frames. lost: whether no tags have
    been found for too long. is_blind: whether no pose was found in the newest frames."""

    def __init__(self, vehicle: str, cameras: Mapping[str, Camera], fleet: EstimateHistory) -> None:
        self._vehicle, self._fleet = vehicle, fleet
        self._timeout = max(BLIND, 2.5 / max((c.rate for c in cameras.values()), default=30.0))
        self._posed: Time | None = None
        self._tracks: dict[str, _Track] = {}
        self.lost = self.is_blind = False

    @property
    def wrong(self) -> dict[str, CameraJumped]:
        """The present jump of each camera that has jumped."""
        found = {name: track.trouble.finding for name, track in self._tracks.items()}
        return {name: event for name, event in found.items() if isinstance(event, CameraJumped)}

    def judge(self, sighting: Sighting, airborne: bool) -> list[VehicleEvent]:
        """Judge a new sighting; return the findings."""
        time, located = sighting.frames[0].time, sighting.located
        self.is_blind = located is None
        if located is None:
            return self._blind(time, airborne)
        self._posed = time
        findings: list[VehicleEvent] = []
        if self.lost:
            self.lost = False
            findings.append(TagsFound())
        if not airborne:  # a person may carry the vehicle around
            self._tracks.clear()
            return findings
        believed = self._fleet.at(self._vehicle, time)
        if believed is not None:
            off = distance(located.position, believed.position)
            deviation = sqrt(max(0.0, *located.covariance.diagonal()[:3].tolist()))
            bound = NEAR + 4.0 * (believed.spread + deviation)
            place = _Place(time, located.position, off, bound)
            names = (view.camera.name for view in located.views if len(view.tags))
            camera = _AND.join(dict.fromkeys(names))
            track = self._tracks.setdefault(camera, _Track(self._timeout))
            findings += track.follow(place, camera, self._whose)
            if place.value <= place.bound:
                # a good pose that several cameras gave together is good for each of them
                for name, other in self._tracks.items():
                    if name != camera and name in camera.split(_AND) and other.trouble.is_over():
                        findings.append(CameraRecovered(camera=name))
        return findings

    def _blind(self, time: Time, airborne: bool) -> list[VehicleEvent]:
        if self._posed is None or not airborne:
            self._posed = time
            return []
        since = (time - self._posed) / NS
        if since <= self._timeout or self.lost:
            return []
        self.lost = True
        return [TagsLost(value=since, bound=self._timeout)]

    def _whose(self, place: _Place) -> str:
        """Return the name of the other vehicle whose estimate was at `place`, empty if none was."""
        others = self._fleet.others(self._vehicle, place.time)
        return nearest(place.position, ((o, b.position, NEAR + 4.0 * b.spread) for o, b in others))


class _Track:
    """The poses that one camera gave, or several together. After a jump, good poses are counted
    only once the poses have jumped back, or return after `timeout` seconds without any."""

    def __init__(self, timeout: float) -> None:
        self._timeout = round(timeout * NS)
        self.trouble = Trouble()
        self._last: _Place | None = None
        self._elsewhere: Consistent[_Place] = Consistent()

    def follow(
        self, place: _Place, camera: str, whose: Callable[[_Place], str]
    ) -> Iterator[VehicleEvent]:
        """Judge the next position; yield the findings. whose: returns the name of the other vehicle
        at a position."""
        trouble, elsewhere = self.trouble, self._elsewhere
        last, self._last = self._last, place
        went = last is not None and (
            place.time - last.time > self._timeout or not place.follows(last)
        )
        is_off = place.value > place.bound
        if went:
            elsewhere.forget()
            trouble.count_anew()
        if trouble.finding is not None and not is_off and (went or trouble.good):
            if trouble.is_over():
                yield CameraRecovered(camera=camera)
            return
        if not (elsewhere.seen or (is_off and (went or trouble.finding is None))):
            return
        first = elsewhere.confirmed(place)
        if first is not None:
            other, value, bound = whose(first), first.value, first.bound
            yield trouble.found(
                CameraSwappedEvent(camera=camera, value=value, bound=bound, other=other)
                if other
                else CameraJumped(camera=camera, value=value, bound=bound)
            )


class SeeingEstimator(Protocol):
    """One of a vehicle's estimators. name: its name in the mission."""

    name: str
    part: Estimator[Any]


class CameraMonitor:
    """Emits the findings on one vehicle's cameras and withholds frozen frames from its estimators.
    Nothing is reported if no estimator uses frames."""

    def __init__(self, plan: VehiclePlan, fleet: EstimateHistory, events: Events) -> None:
        self._name, self._events = plan.name, events
        parts = (estimator.part for estimator in plan.estimators)
        asking = [p.at for p in parts if Frame in p.cls.uses(p.params)]
        self._at = asking[0] if asking else ""
        self.is_asked = bool(asking)
        if asking:
            fleet.ask()
        self._streams = CameraStreams(plan.cameras)
        self._sightings = Sightings(plan.name, plan.cameras, fleet)
        self._seen: dict[str, object] = {}

    @property
    def is_blind(self) -> bool:
        """Whether frames arrive, but no pose was found in the newest ones."""
        return self._sightings.is_blind

    @property
    def trouble(self) -> str | None:
        """A description of the present faults, or None without any."""
        said = []
        for name, event in self._streams.wrong.items():
            if isinstance(event, CameraFroze):
                said.append(f"the camera `{name}` froze")
            elif isinstance(event, CameraLostEvent):
                said.append(f"the camera `{name}` gives no frames")
        for name, found in self._sightings.wrong.items():
            if isinstance(found, CameraSwappedEvent):
                said.append(f"the camera `{name}` shows where `{found.other}` is")
            else:
                said.append(f"what the camera `{name}` shows jumped by {found.value:.2f} m")
        if self._sightings.lost:
            said.append("no tag is found in the frames")
        return "; ".join(said) or None

    def measured(
        self, measurements: Sequence[Measurement], now: Time, airborne: bool
    ) -> Sequence[Measurement]:
        """Return the measurements without frozen frames."""
        frames = [m for m in measurements if type(m) is Frame] if measurements else ()
        if frames or now >= self._streams.due:
            self._emit(self._streams.judge(frames, now, airborne))
        if not frames:
            return measurements
        wrong = self._streams.wrong
        frozen = [name for name, event in wrong.items() if isinstance(event, CameraFroze)]
        if not frozen:
            return measurements
        return [m for m in measurements if type(m) is not Frame or m.camera not in frozen]

    def judge(self, estimators: Sequence[SeeingEstimator], airborne: bool) -> None:
        """Judge the poses that the estimators found in new frames, except frames of a faulty
        camera."""
        fresh = []
        for estimator in estimators:
            sighting = estimator.part.sighting
            if sighting is not None and self._seen.get(estimator.name) is not sighting:
                self._seen[estimator.name] = sighting
                if not any(frame.camera in self._streams.wrong for frame in sighting.frames):
                    fresh.append(sighting)
        if fresh:
            best = next((s for s in fresh if s.located is not None), fresh[0])
            self._emit(self._sightings.judge(best, airborne))

    def _emit(self, findings: Sequence[VehicleEvent]) -> None:
        for found in findings:
            self._events.emit(found, self._name, self._at)
