"""Count how often it is called, and emit an event when it was often enough.

The count is the callback's own: each place that names `tally` counts for itself, from zero when the
run begins. It emits `tally_reached` once, in the call with the number `most`.
"""

from __future__ import annotations

from kybflow.core.signals import Event
from kybflow.parts import Action, ActionContext, param, params


@params
class TallyParams:
    most: int = param("How many calls are often enough.", default=3, at_least=1)


class Tally(Action[TallyParams]):
    """Counts its calls."""

    events = ("tally_reached",)

    def __init__(self, params: TallyParams) -> None:
        super().__init__(params)
        self._calls = 0

    def __call__(self, event: Event, context: ActionContext) -> None:
        self._calls += 1
        context.log(f"{event.name} of {event.vehicle}: {self._calls} of {self.params.most}")
        if self._calls == self.params.most:
            context.emit("tally_reached")
