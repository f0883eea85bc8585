"""Streaming statistics of one value, and the samplers that feed them once a tick."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import inf, sqrt

from kybflow.dsl.expressions import Aggregate
from kybflow.parts.observables import Unavailable, View, is_in


class Statistics:
    """Mean, root mean square, minimum and maximum of the added values; None before the first."""

    __slots__ = ("count", "high", "low", "squares", "total")

    def __init__(self) -> None:
        self.count = 0
        self.total = self.squares = 0.0
        self.low, self.high = inf, -inf

    def add(self, value: float) -> None:
        self.count += 1
        self.total += value
        self.squares += value * value
        if value < self.low:  # noqa: PLR1730 - `min` costs three times as much, every tick
            self.low = value
        if value > self.high:  # noqa: PLR1730
            self.high = value

    def mean(self) -> float | None:
        return self.total / self.count if self.count else None

    def rms(self) -> float | None:
        return sqrt(self.squares / self.count) if self.count else None

    def min(self) -> float | None:
        return self.low if self.count else None

    def max(self) -> float | None:
        return self.high if self.count else None


Source = tuple[object, str | None, str | None]
"""(value, vehicle, state); aggregates with equal sources share one sampler."""


class Samplers:
    """One sampler for each value in each state, however many aggregates read it."""

    def __init__(
        self, views: Mapping[str, View], read: Callable[[Aggregate], Callable[[], float]]
    ) -> None:
        self._views = views
        self._read = read
        self._known: dict[Source, Statistics] = {}
        self._by_state: dict[tuple[str | None, str | None], list[Sampler]] = {}

    def statistics(self, aggregate: Aggregate) -> Statistics:
        """Return the statistics that `aggregate` reads."""
        place = (aggregate.vehicle, aggregate.state)
        source = (aggregate.value, *place)
        if source not in self._known:
            sampler = Sampler(self._read(aggregate))
            self._known[source] = sampler.statistics
            self._by_state.setdefault(place, []).append(sampler)
        return self._known[source]

    def groups(self) -> list[Callable[[], None]]:
        """Return the functions to call once a tick; each checks a vehicle's state only once."""
        return [
            _group(
                self._views[vehicle] if vehicle is not None else None,
                state,
                [sampler.sample for sampler in samplers],
            )
            for (vehicle, state), samplers in self._by_state.items()
        ]


class Sampler:
    """Adds a value to its statistics in each tick in which the value is available."""

    def __init__(self, read: Callable[[], float]) -> None:
        self.statistics = Statistics()
        self._read = read
        self._add = self.statistics.add

    def sample(self) -> None:
        try:
            self._add(self._read())
        except Unavailable:
            return


def _group(
    view: View | None, state: str | None, samples: list[Callable[[], None]]
) -> Callable[[], None]:
    def always() -> None:
        for sample in samples:
            sample()

    if view is None or state is None:
        return always
    watched = view

    def while_in_state() -> None:
        if is_in(watched.behavior, state):
            for sample in samples:
                sample()

    return while_in_state
