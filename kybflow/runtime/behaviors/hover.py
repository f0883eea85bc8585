"""Hold the position and heading of entry, for a time or until the state is left.

A vehicle in motion first comes to rest (`kybflow.flight.motion`) and holds that point. The behavior
never refuses to start, at any speed (TeleKyb's Hover refused above 0.2 m/s).
Position in the world, metres; heading in radians from east.
"""

from __future__ import annotations

from kybflow.core.signals import Done, Setpoint, SetpointKind, Tick
from kybflow.core.units import Duration, Vec3
from kybflow.flight.motion import Coast
from kybflow.parts import AIR, Behavior, Entry, Footprint, param, params


@params
class HoverParams:
    for_time: Duration | None = param(
        "Time to hover; by default the behavior never ends.", default=None, at_least=0.0
    )


class Hover(Behavior[HoverParams], flight=AIR >> AIR, emits=SetpointKind.POSITION):
    def __init__(self, params: HoverParams, entry: Entry) -> None:
        super().__init__(params, entry)
        self._heading = entry.heading
        self._coast = Coast.after(entry.motion)
        self._held = self._coast.at(self._coast.duration).setpoint(self._heading)

    def update(self, tick: Tick) -> Setpoint | Done:
        setpoint = self._held
        if tick.elapsed < self._coast.duration:
            setpoint = self._coast.at(tick.elapsed).setpoint(self._heading)
        wanted = self.params.for_time
        if wanted is not None and tick.elapsed >= max(wanted, self._coast.duration):
            return Done(setpoint)
        return setpoint

    @classmethod
    def footprint(cls, params: HoverParams, entry: Vec3 | None) -> Footprint | None:
        points = () if entry is None else (entry,)
        time = params.for_time
        return Footprint(points, 0.0, entry, time is None, duration=time, longest=time)
