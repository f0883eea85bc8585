"""The operator: events that a person sends during a mission, at once or at scheduled times.

A mission may wait for an event of any name. These also act on every vehicle: `operator.pause` and
`operator.resume` hold it and let it go on, `operator.land` lands it, `operator.reset` takes it out
of `fault` on the ground, `operator.stop` lands it and ends the run.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

from kybflow.core.errors import EventRefused
from kybflow.core.signals import NS, Time
from kybflow.core.text import did_you_mean
from kybflow.dsl.plan import ActionPlan, Call, Emit, Plan
from kybflow.runtime.events import Events
from kybflow.runtime.vehicle.requests import Requests

BY = "operator"
PREFIX = "operator."

LAND = "operator.land"
_ORDERS: Mapping[str, Callable[[Requests], None]] = {
    "operator.pause": lambda requests: requests.pause(BY),
    "operator.resume": lambda requests: requests.resume(BY),
    LAND: lambda requests: requests.retire("a person landed it"),
    "operator.reset": lambda requests: requests.reset(BY),
}
STOP = "operator.stop"
COMMANDS = (*_ORDERS, STOP)
"""The events that act whether or not the mission waits for them."""


class Operator:
    """scheduled: the events to send, each with its time in seconds of the run."""

    def __init__(
        self,
        requests: Sequence[Requests],
        events: Events,
        stop: Callable[[str], None],
        scheduled: Iterable[tuple[float, str]] = (),
    ) -> None:
        self._requests, self._events, self._stop = tuple(requests), events, stop
        times = sorted((round(seconds * NS), name) for seconds, name in scheduled)
        self._waiting: deque[tuple[Time, str]] = deque(times)

    def step(self, now: Time) -> None:
        """Send the scheduled events that are due."""
        while self._waiting and self._waiting[0][0] <= now:
            self.give(self._waiting.popleft()[1])

    @property
    def waiting(self) -> tuple[tuple[float, str], ...]:
        """The scheduled events that have not been sent yet, each with its seconds of the run."""
        return tuple((due / NS, name) for due, name in self._waiting)

    def give(self, name: str) -> None:
        """Publish the event `name` and do what it commands."""
        self._events.tell(name)
        order = _ORDERS.get(name)
        if order is not None:
            for requests in self._requests:
                order(requests)
        elif name == STOP:
            self._stop("stopped by the operator")


def check_emitted(plan: Plan, names: Iterable[str]) -> None:
    """Raises EventRefused for the first of `names` that the mission doesn't wait for."""
    known = {*_awaited(plan), *COMMANDS}
    for name in names:
        if name not in known:
            hint = did_you_mean(name, known)
            raise EventRefused(f"the mission doesn't wait for `{name}`; {hint}")


def _awaited(plan: Plan) -> Iterator[str]:
    """Yield the operator's and the mission's own events that a transition or a callback hears."""
    own = {name for one in plan.callbacks for action in one.actions for name in _emitted(action)}
    states = (state for vehicle in plan.vehicles for state in vehicle.states.values())
    phases = (phase for flow in plan.flows for phase in flow.phases.values())
    heard = {transition.event for state in states for transition in state.transitions}
    heard |= {transition.event for phase in phases for transition in phase.transitions}
    heard |= {callback.event for callback in plan.callbacks if callback.vehicles == ("",)}
    for name in heard:
        if name is not None and (name in own or name.startswith(PREFIX)):
            yield name


def _emitted(action: ActionPlan) -> tuple[str, ...]:
    if isinstance(action, Emit):
        return (action.name,)
    return action.part.cls.events if isinstance(action, Call) else ()
