"""What the fleet's judge says of the poses of one vehicle: told as events, and what is no
measurement withheld."""

from __future__ import annotations

from collections.abc import Sequence

from kybflow.core.signals import NEVER, Measurement, Pose, Time
from kybflow.dsl.plan import VehiclePlan
from kybflow.runtime.events import Events
from kybflow.runtime.monitoring.body_health import Bodies, Finding


class WatchedBody:
    """The body of one vehicle; `bodies` is the judge of them all. Poses that no estimator asks for
    are judged where they come, and nobody misses them. due: when to be asked without any."""

    def __init__(self, plan: VehiclePlan, bodies: Bodies, events: Events) -> None:
        self._name, self._bodies, self._events = plan.name, bodies, events
        parts = (estimator.part for estimator in plan.estimators)
        asking = [p.at for p in parts if Pose in p.cls.uses(p.params)]
        self._at = asking[0] if asking else plan.at
        self._is_needed = bool(asking)
        self.due: Time = 0 if asking else NEVER

    def measured(
        self, measurements: Sequence[Measurement], now: Time, in_air: bool
    ) -> Sequence[Measurement]:
        """The measurements without the poses that are none. in_air: whether the vehicle is."""
        poses = [m for m in measurements if type(m) is Pose] if measurements else ()
        if not poses and now < self.due:
            return measurements
        passed, findings = self._bodies.judge(self._name, poses, now, in_air)
        if self._is_needed:
            self.due = self._bodies.due(self._name)
        for finding in findings:
            self._tell(finding)
        if len(passed) == len(poses):
            return measurements
        good = set(map(id, passed))
        return [m for m in measurements if type(m) is not Pose or id(m) in good]

    def _tell(self, found: Finding) -> None:
        tell, name, at = self._events.tell, self._name, self._at
        value, bound = found.value, found.bound
        match found.event:
            case "body_lost":
                tell("body_lost", name, at, value=value, bound=bound)
            case "body_froze":
                tell("body_froze", name, at, value=value, bound=bound)
            case "body_jumped":
                tell("body_jumped", name, at, value=value, bound=bound)
            case "body_swapped":
                tell("body_swapped", name, at, other=found.other, value=value, bound=bound)
            case "body_recovered":
                tell("body_recovered", name, at)
