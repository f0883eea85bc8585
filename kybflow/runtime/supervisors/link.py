"""Report a link that has fallen silent, or slow.

It raises the alarm `link_lost` if, in the air, no measurement has arrived from the vehicle for
longer than `age`; other messages, such as heartbeats, don't count. Commands don't reach such a
vehicle either; its own watchdog acts then. The value is the silence in seconds.

It raises the alarm `link_slow` if, in the air, the two newest round trips to the vehicle both took
longer than `delay`. A loop that is closed over the link becomes unstable when its delay reaches its
phase margin divided by its crossover frequency: with the default gains 1.24 rad / 3.5 rad/s = 0.35
s for accelerations (`on_board`) and 1.41 rad / 7.5 rad/s = 0.19 s for attitudes (`cascade`),
including the vehicle's own lag. The value is the shorter round trip in seconds. With drivers that
measure no round trips it is never raised; `mavlink` and `ardrone` measure five a second.

The default reaction is `land`, or `land_blind` if there is no estimate by then. An autopilot lands
by its own land mode, whose loops don't include the link.
"""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.core.signals import Alarm, Reaction, ReactionName, Tick
from kybflow.core.units import Duration
from kybflow.parts import Objection, Supervisor, param, params
from kybflow.world.vehicle_context import VehicleContext

_USUAL_SILENCE_S, _MAX_SILENCE_S = 0.05, 10.0
"""Seconds of silence that occasionally occur on a radio, and after which it is lost for good."""
_MAX_ROUND_TRIP_S = 2.0
"""A round trip (s) several times as long as the one at which the slowest loop oscillates."""


@params
class LinkSupervisorParams:
    age: Duration = param("Longest silence.", default=0.5, above=0.0, tightens="down")
    delay: Duration = param("Longest round trip.", default=0.2, above=0.0, tightens="down")
    reaction: ReactionName = param("What the failsafe does.", default="land", tightens="up")


class LinkSupervisor(Supervisor[LinkSupervisorParams]):
    always = True
    unhurried = True
    events = ("link_lost", "link_slow")

    @classmethod
    def objections(
        cls, params: LinkSupervisorParams, context: VehicleContext
    ) -> Iterator[Objection]:
        p = params
        tick = f"a tick takes {context.dt * 1e3:.3g} ms"
        if p.age <= context.dt:
            reason = f"alarms with the first late packet: {tick}"
            yield Objection("age", reason, "write `age: 500 ms`", p.reaction == "warn")
        elif p.age < _USUAL_SILENCE_S:
            reason = "alarms when a few packets are late"
            yield Objection("age", reason, "write `age: 500 ms`", is_doubt=True)
        if p.age > _MAX_SILENCE_S:
            reason = f"leaves the vehicle alone for {p.age:.3g} s"
            yield Objection("age", reason, "write `age: 500 ms`", is_doubt=True)
        if p.delay <= context.dt:
            reason = f"alarms with the first round trip: {tick}"
            yield Objection("delay", reason, "write `delay: 200 ms`", p.reaction == "warn")
        if p.delay > _MAX_ROUND_TRIP_S:
            reason = "alarms long after a loop over the link oscillates"
            yield Objection("delay", reason, "write `delay: 200 ms`", is_doubt=True)

    def check(self, tick: Tick, off_ground: bool) -> Alarm | None:
        p, silence, delay = self.params, tick.link_age, tick.link_delay
        if not off_ground:
            return None
        reaction = Reaction[p.reaction.upper()]
        if silence > p.age:
            reason = f"no measurement has arrived for {silence:.2f} s, {p.age:g} s allowed"
            return Alarm("link_lost", reaction, reason, silence, p.age)
        if delay > p.delay:
            reason = f"two round trips in a row took {delay:.2f} s and more, {p.delay:g} s allowed"
            return Alarm("link_slow", reaction, reason, delay, p.delay)
        return None
