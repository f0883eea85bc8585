"""The processors and the tracker of one flight: setpoint ─► processors ─► tracker ─► command.

Made anew at each take-off, so that no state of the last flight is left.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from kybflow.dsl.plan import VehiclePlan
from kybflow.parts import Processor, Tracker
from kybflow.signals import Alarm, Command, Setpoint, Tick
from kybflow.site import Site


class Chain:
    """`stage` names the part at work, for the report when it raises."""

    def __init__(self, plan: VehiclePlan, site: Site, params: dict[str, Any]) -> None:
        self.processors: dict[str, Processor[Any]] = {
            part.label: part.cls(params[part.label], site) for part in plan.processors
        }
        self.tracker: Tracker[Any] = plan.tracker.cls(params[plan.tracker.label], site)
        self.stage = ""
        self._tracker_label = plan.tracker.label
        self._active: tuple[tuple[str, Processor[Any]], ...] = ()

    def select(self, stays_in_air: bool) -> None:
        """Choose the processors for a behavior: all in the air, the safety ones from take-off to
        touch-down."""
        self._active = tuple((n, p) for n, p in self.processors.items() if stays_in_air or p.safety)

    def follow(
        self, setpoint: Setpoint, tick: Tick, heed: Callable[[Alarm, Tick], bool]
    ) -> tuple[Setpoint, Command] | None:
        """(the setpoint that the tracker followed, its command).

        `heed` is told of a processor's alarm; when it says that the vehicle now does something
        else, the setpoint is out of date and the result is None. Otherwise the setpoint passes
        unchanged.
        """
        for label, processor in self._active:
            self.stage = label
            output = processor(setpoint, tick)
            if isinstance(output, Alarm):
                if heed(output, tick):
                    return None
            else:
                setpoint = output
        self.stage = self._tracker_label
        return setpoint, self.tracker.update(setpoint, tick)

    def parts(self) -> dict[str, Any]:
        """The living parts by label."""
        return {**self.processors, self._tracker_label: self.tracker}
