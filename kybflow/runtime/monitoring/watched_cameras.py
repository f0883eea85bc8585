"""What is found of the cameras of one vehicle: told as events, and as the reason why an estimate
that came from them is gone. Estimators know nothing of it, but are not given frozen images."""

from __future__ import annotations

from collections.abc import Sequence

from kybflow.core.signals import Frame, Measurement, Time
from kybflow.dsl.plan import VehiclePlan
from kybflow.runtime.events import Events, Fields
from kybflow.runtime.monitoring.camera_health import FROZE, LOST, Cameras, Finding
from kybflow.runtime.monitoring.estimate_history import Whereabouts
from kybflow.runtime.monitoring.sighting_health import SWAPPED, Sights
from kybflow.runtime.vehicle.candidate import Candidate


class WatchedCameras:
    """`fleet` is where the vehicles believe to be. Where no estimator asks for frames, nobody
    misses them, and nothing is told."""

    def __init__(self, plan: VehiclePlan, fleet: Whereabouts, events: Events) -> None:
        self._name, self._events = plan.name, events
        parts = (estimator.part for estimator in plan.estimators)
        asking = [p.at for p in parts if Frame in p.cls.uses(p.params)]
        self._at = asking[0] if asking else ""
        self.is_asked = bool(asking)
        fleet.is_asked = fleet.is_asked or self.is_asked
        self._cameras = Cameras(plan.cameras)
        self._sights = Sights(plan.name, plan.cameras, fleet)
        self._seen: dict[str, object] = {}

    @property
    def is_blind(self) -> bool:
        """Whether frames arrive, and the newest tell no pose."""
        return self._sights.is_blind

    @property
    def trouble(self) -> str | None:
        """What is known to be wrong, in words; None where nothing is."""
        said = []
        for name, event in self._cameras.wrong.items():
            if event == FROZE:
                said.append(f"the camera `{name}` froze")
            elif event == LOST:
                said.append(f"the camera `{name}` gives no frames")
        for name, found in self._sights.wrong.items():
            if found.event == SWAPPED:
                said.append(f"the camera `{name}` shows where `{found.other}` is")
            else:
                said.append(f"what the camera `{name}` shows jumped by {found.value:.2f} m")
        if self._sights.lost:
            said.append("no tag is found in the frames")
        return "; ".join(said) or None

    def measured(
        self, measurements: Sequence[Measurement], now: Time, in_air: bool
    ) -> Sequence[Measurement]:
        """The measurements without the frames that froze, which show nothing of now. in_air:
        whether the vehicle is."""
        frames = [m for m in measurements if type(m) is Frame] if measurements else ()
        if frames or now >= self._cameras.due:
            self._tell(self._cameras.judge(frames, now, in_air))
        frozen = [name for name, event in self._cameras.wrong.items() if event == FROZE]
        if not frames or not frozen:
            return measurements
        return [m for m in measurements if type(m) is not Frame or m.camera not in frozen]

    def see(self, candidates: Sequence[Candidate], in_air: bool) -> None:
        """What estimators made of them; of a frozen image nothing new can be found."""
        fresh = []
        for candidate in candidates:
            sighting = candidate.part.sighting
            if sighting is not None and self._seen.get(candidate.name) is not sighting:
                self._seen[candidate.name] = sighting
                if not any(frame.camera in self._cameras.wrong for frame in sighting.frames):
                    fresh.append(sighting)
        if fresh:
            best = next((s for s in fresh if s.located is not None), fresh[0])
            self._tell(self._sights.judge(best, in_air))

    def _tell(self, findings: Sequence[Finding]) -> None:
        tell, name, at = self._events.tell, self._name, self._at
        for event, camera, value, bound, other in findings:
            found: dict[str, Fields] = {"camera": camera, "value": value, "bound": bound}
            match event:
                case "camera_lost":
                    tell("camera_lost", name, at, **found)
                case "camera_froze":
                    tell("camera_froze", name, at, **found)
                case "camera_jumped":
                    tell("camera_jumped", name, at, **found)
                case "camera_swapped":
                    tell("camera_swapped", name, at, **found, other=other)
                case "camera_recovered":
                    tell("camera_recovered", name, at, camera=camera)
                case "tags_lost":
                    tell("tags_lost", name, at, value=value, bound=bound)
                case "tags_found":
                    tell("tags_found", name, at)
