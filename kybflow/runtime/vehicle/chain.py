"""The processors and the tracker of one flight: setpoint ─► processors ─► tracker ─► command.

Made anew at each take-off, so that no state of the last flight is left.
"""

from __future__ import annotations

from collections.abc import Callable, Set
from typing import Any

from kybflow.core.signals import Alarm, Command, Setpoint, Tick
from kybflow.dsl.plan import VehiclePlan
from kybflow.parts import Processor, Tracker
from kybflow.runtime.finite import checked_command, checked_setpoint
from kybflow.runtime.making import make
from kybflow.world.vehicle_context import VehicleContext

Process = Callable[[Setpoint, Tick], Setpoint | Alarm]


class Chain:
    """`stage` is the label of the part at work, empty while none is: it tells which one raised.
    Raises PartFailed for a part that can't be made."""

    def __init__(self, plan: VehiclePlan, context: VehicleContext, params: dict[str, Any]) -> None:
        self.processors: dict[str, Processor[Any]] = {
            part.label: make(part, params[part.label], context) for part in plan.processors
        }
        self.tracker: Tracker[Any] = make(plan.tracker, params[plan.tracker.label], context)
        self.stage = ""
        self._tracker_label = plan.tracker.label
        self._active: tuple[tuple[str, Process], ...] = ()

    def select(self, stays_in_air: bool, off: Set[str]) -> None:
        """Choose the processors for a behavior: all in the air, the safety ones from take-off to
        touch-down; without those whose labels are `off`."""
        self._active = tuple(
            (label, processor.__call__)  # called as a method it costs less than as an object
            for label, processor in self.processors.items()
            if (stays_in_air or processor.safety) and label not in off
        )

    def drop(self, label: str) -> bool:
        """Leave out the processor `label`, which has failed; false when it is none."""
        self._active = tuple(active for active in self._active if active[0] != label)
        return self.processors.pop(label, None) is not None

    def follow(
        self, setpoint: Setpoint, tick: Tick, heed: Callable[[str, Alarm, Tick], bool]
    ) -> tuple[Setpoint, Command] | None:
        """(the setpoint that the tracker followed, its command).

        `heed` is told of a processor's label and alarm; when it says that the vehicle now does
        something else, the setpoint is out of date and the result is None. Otherwise the setpoint
        passes unchanged. Raises ValueError for a setpoint or a command that is not finite.
        """
        for label, process in self._active:
            self.stage = label
            output = process(setpoint, tick)
            if isinstance(output, Alarm):
                self.stage = ""
                if heed(label, output, tick):
                    return None
            elif output is not setpoint:
                setpoint = checked_setpoint(output)
        self.stage = self._tracker_label
        command = checked_command(self.tracker.update(setpoint, tick))
        self.stage = ""
        return setpoint, command

    def parts(self) -> dict[str, Any]:
        """The living parts by label."""
        return {**self.processors, self._tracker_label: self.tracker}
