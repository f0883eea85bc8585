"""Judges a mission's expectations (`expect:`) during the run.

The engine calls `Judge.sample` once a tick; `Judge.verdicts` is called once, at the end. Samples
are not stored, only running figures. An aggregate or comparison that was never sampled has the
value None, and its expectation does not hold. The time for which a value is unknown while its
vehicle flies is counted, because nothing is known about the expectation then.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from math import atan2, cos, inf, sin, sqrt
from typing import Any, NamedTuple, Protocol

from kybflow.dsl.expressions import tree
from kybflow.dsl.expressions.semantics import is_direction, observable_of
from kybflow.dsl.plan import ExpectationPlan
from kybflow.parts.observables import Unavailable, View, is_in
from kybflow.runtime.conditions import OPERATORS, reader_of, value_of

Now = Callable[[], float]


class Assessment(NamedTuple):
    """The result of an expectation.

    value: the measured value, for `always` the worst one; None if there is none.
    margin: the distance to the bound, negative if it was violated; None without a bound.
    unit: the SI unit of both.
    unknown: the number of ticks in flight without a value.
    when: the time of the value, s: for an `eventually` that did not hold, of the one nearest to the
    bound, for an `always` that did not hold, of the worst; otherwise None.
    """

    held: bool
    value: float | None
    margin: float | None
    unit: str
    unknown: int = 0
    when: float | None = None


class Verdict(NamedTuple):
    """One line of `expect:` and its result, as in `Assessment`. at: where the line is in the
    mission. unknown: the seconds in flight for which its value was unknown."""

    text: str
    held: bool
    value: float | None
    margin: float | None
    unit: str
    at: str
    unknown: float = 0.0
    when: float | None = None


class Expectation(Protocol):
    def sample(self) -> None: ...
    def found(self, finished_at: float | None) -> Assessment: ...


class Judge:
    """Judges every expectation of a mission. views: the vehicles' true states in simulation, their
    estimates on hardware. now: returns the seconds since the start of the run. period: the seconds
    between two samples."""

    def __init__(
        self, plans: Sequence[ExpectationPlan], views: Mapping[str, View], now: Now, period: float
    ) -> None:
        self._plans, self._period = tuple(plans), period
        samplers = _Samplers(views, lambda a: value_of(a.value, views, a.vehicle, now))
        self._expectations = [_expectation(p, views, now, samplers) for p in plans]
        self._samples = samplers.groups()
        self._samples += [e.sample for e in self._expectations if not isinstance(e, _AtTheEnd)]

    def sample(self) -> None:
        """Sample every expectation. The engine calls it once a tick."""
        for sample in self._samples:
            sample()

    def verdicts(self, finished_at: float | None) -> tuple[Verdict, ...]:
        """Return the verdicts. finished_at: when the run was completed (s), None if it was not."""
        verdicts = list[Verdict]()
        for plan, expectation in zip(self._plans, self._expectations, strict=True):
            held, value, margin, unit, unknown, when = expectation.found(finished_at)
            seconds = unknown * self._period
            verdicts.append(Verdict(plan.text, held, value, margin, unit, plan.at, seconds, when))
        return tuple(verdicts)


def _expectation(
    plan: ExpectationPlan, views: Mapping[str, View], now: Now, samplers: _Samplers
) -> Expectation:
    match plan.expression:
        case tree.Compare(operator, tree.Aggregate() as left, right):
            return _Statistic(operator, left, right, samplers)
        case tree.Always(condition):
            if isinstance(condition, tree.Compare) and condition.operator in _ORDERS:
                return _Bound(condition, views, now)
            return _Unbroken(reader_of(condition, views, None, now))
        case tree.Eventually(condition, within):
            return _Once(condition, views, within, now)
        case tree.Finally(condition):
            return _Last(condition, views, now)
        case tree.Finished(within):
            return _InTime(within)
    raise TypeError(f"{plan.text!r} is not an expectation")


class _AtTheEnd:
    """An expectation that is evaluated only at the end of the run."""

    def sample(self) -> None:
        """Do nothing."""


class _Statistic(_AtTheEnd):
    """`mean(mk.position_error in eight) < 3.4 cm`; the samplers collect the values."""

    def __init__(
        self, operator: str, left: tree.Aggregate, right: object, samplers: _Samplers
    ) -> None:
        self._operator = operator
        self._left = _reader(left, samplers)
        self._right = _reader(right, samplers)
        self._unit = _unit(left)
        self._sampled = samplers.statistics(left)

    def found(self, finished_at: float | None) -> Assessment:
        value, bound, unknown = self._left(), self._right(), self._sampled.unknown
        if value is None or bound is None:
            return Assessment(False, None, None, self._unit, unknown)
        held = OPERATORS[self._operator](value, bound)
        return Assessment(held, value, _margin(self._operator, value, bound), self._unit, unknown)


class _Bound:
    """`always separation(all) > 60 cm`: records the worst value, its margin and its time. Ticks in
    which the value is unavailable are only counted."""

    def __init__(self, condition: tree.Compare, views: Mapping[str, View], now: Now) -> None:
        self._unit = _unit(condition.left)
        self._holds = OPERATORS[condition.operator]
        self._sign = _ORDERS[condition.operator]
        self._left = value_of(condition.left, views, None, now)
        self._right = value_of(condition.right, views, None, now)
        self._flies = _flies(condition.left, views)
        self._now = now
        self._held = True
        self._value: float | None = None
        self._margin, self._when = inf, 0.0
        self._unknown = 0

    def sample(self) -> None:
        try:
            value, bound = self._left(), self._right()
        except Unavailable:
            self._unknown += self._flies()
            return
        margin = (bound - value) * self._sign
        if margin < self._margin:
            self._margin, self._value, self._when = margin, value, self._now()
            self._held = self._holds(value, bound)

    def found(self, finished_at: float | None) -> Assessment:
        if self._value is None:
            return Assessment(False, None, None, self._unit, self._unknown)
        when = None if self._held else self._when
        return Assessment(self._held, self._value, self._margin, self._unit, self._unknown, when)


class _Unbroken:
    """`always` with a condition that is not a comparison with `<`, `<=`, `>` or `>=`."""

    def __init__(self, condition: Callable[[], bool]) -> None:
        self._condition = condition
        self._held: bool | None = None

    def sample(self) -> None:
        if self._held is not False:
            self._held = self._condition()

    def found(self, finished_at: float | None) -> Assessment:
        return Assessment(bool(self._held), None, None, "")


class _Once:
    """`eventually`: the value is the time at which the condition first held. If it never held and
    is a comparison, it is the value that was nearest to the bound."""

    def __init__(
        self,
        condition: tree.Condition,
        views: Mapping[str, View],
        within: float | None,
        now: Now,
    ) -> None:
        self._condition = reader_of(condition, views, None, now)
        self._within, self._now = within, now
        self._at: float | None = None
        self._unit, self._sign = "s", 0.0
        self._nearest, self._value, self._when = -inf, 0.0, 0.0
        if isinstance(condition, tree.Compare) and condition.operator in _ORDERS:
            self._unit, self._sign = _unit(condition.left), _ORDERS[condition.operator]
            self._left = value_of(condition.left, views, None, now)
            self._right = value_of(condition.right, views, None, now)

    def sample(self) -> None:
        if self._at is not None:
            return
        if self._condition():
            self._at = self._now()
        elif self._sign:
            self._approach()

    def _approach(self) -> None:
        try:
            value, bound = self._left(), self._right()
        except Unavailable:
            return
        margin = (bound - value) * self._sign
        if margin > self._nearest:
            self._nearest, self._value, self._when = margin, value, self._now()

    def found(self, finished_at: float | None) -> Assessment:
        if self._at is None and self._nearest > -inf:
            return Assessment(False, self._value, self._nearest, self._unit, when=self._when)
        if self._at is None:
            return Assessment(False, None, None, "s")
        if self._within is None:
            return Assessment(True, self._at, None, "s")
        return Assessment(self._at <= self._within, self._at, self._within - self._at, "s")


class _Last(_AtTheEnd):
    """`finally`: evaluated once, after the last tick."""

    def __init__(self, condition: tree.Condition, views: Mapping[str, View], now: Now) -> None:
        self._condition = reader_of(condition, views, None, now)
        self._made: Callable[[], _Bound] | None = None
        if isinstance(condition, tree.Compare) and condition.operator in _ORDERS:
            self._made = partial(_Bound, condition, views, now)

    def found(self, finished_at: float | None) -> Assessment:
        if self._made is None:
            return Assessment(self._condition(), None, None, "")
        bound = self._made()
        bound.sample()
        return bound.found(finished_at)._replace(when=None)


class _InTime(_AtTheEnd):
    """`finished within 60 s`: the value is the time at which the run completed."""

    def __init__(self, within: float) -> None:
        self._within = within

    def found(self, finished_at: float | None) -> Assessment:
        if finished_at is None:
            return Assessment(False, None, None, "s")
        margin = self._within - finished_at
        return Assessment(margin >= 0.0, finished_at, margin, "s")


_ORDERS: Mapping[str, float] = {"<": 1.0, "<=": 1.0, ">": -1.0, ">=": -1.0}


def _reader(value: object, samplers: _Samplers) -> Callable[[], float | None]:
    if isinstance(value, tree.Quantity):
        constant = value.value
        return lambda: constant
    if not isinstance(value, tree.Aggregate):
        raise TypeError(f"{value!r} can't be compared with a statistic")
    statistics = samplers.statistics(value)
    readers: dict[str, Callable[[], float | None]] = {
        "mean": statistics.mean,
        "rms": statistics.rms,
        "min": statistics.min,
        "max": statistics.max,
    }
    return readers[value.function]


def _margin(operator: str, value: float, bound: float) -> float | None:
    sign = _ORDERS.get(operator)
    return None if sign is None else (bound - value) * sign


def _unit(value: Any) -> str:
    """Return the SI unit of the measured value."""
    if isinstance(value, tree.Aggregate):
        value = value.value
    if isinstance(value, tree.Read | tree.ObjectRead):
        dimension = observable_of(value).dimension
        return dimension.si if dimension is not None else ""
    if isinstance(value, tree.Quantity):
        return value.dimension.si
    if isinstance(value, tree.MissionTime):
        return "s"
    return "" if isinstance(value, tree.Word) else "m"


def _flies(value: Any, views: Mapping[str, View]) -> Callable[[], bool]:
    """Return a function that returns whether any vehicle flies whose value this is."""
    match value:
        case tree.Read(vehicle, _):
            names: tuple[str | None, ...] = (vehicle,)
        case tree.Distance(a, b):
            names = (a.vehicle, b.vehicle)
        case tree.Separation(vehicles, _):
            names = vehicles
        case tree.Clearance(vehicle, _):
            names = (vehicle,)
        case _:
            names = ()
    seen = [views[name] for name in names if name is not None]
    return lambda: any(view.airborne for view in seen)


class _Statistics:
    """Mean, root mean square, minimum and maximum of the values added so far; None without any.
    unknown: the number of ticks in flight without a value."""

    __slots__ = ("count", "high", "low", "squares", "total", "unknown")

    def __init__(self) -> None:
        self.count = self.unknown = 0
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


class _Directions(_Statistics):
    """Statistics of headings (rad), whose mean is that of the directions: between 170 and -170
    degrees it is 180 (Mardia and Jupp, Directional Statistics, 2000, section 2.2.1)."""

    __slots__ = ("east", "north")

    def __init__(self) -> None:
        super().__init__()
        self.east = self.north = 0.0

    def add(self, value: float) -> None:
        super().add(value)
        self.east += cos(value)
        self.north += sin(value)

    def mean(self) -> float | None:
        return atan2(self.north, self.east) if self.count else None


_Source = tuple[object, str | None, str | None]
"""(value, vehicle, state); aggregates with equal sources share one sampler."""


class _Samplers:
    """Holds one sampler for each pair of a value and a state, shared by all aggregates of it."""

    def __init__(
        self, views: Mapping[str, View], read: Callable[[tree.Aggregate], Callable[[], float]]
    ) -> None:
        self._views = views
        self._read = read
        self._known: dict[_Source, _Statistics] = {}
        self._by_state: dict[tuple[str | None, str | None], list[_Sampler]] = {}

    def statistics(self, aggregate: tree.Aggregate) -> _Statistics:
        """Return the statistics that `aggregate` reads."""
        place = (aggregate.vehicle, aggregate.state)
        source = (aggregate.value, *place)
        if source not in self._known:
            value, flies = aggregate.value, _flies(aggregate.value, self._views)
            statistics = _Directions() if is_direction(value) else _Statistics()
            sampler = _Sampler(self._read(aggregate), flies, statistics)
            self._known[source] = sampler.statistics
            self._by_state.setdefault(place, []).append(sampler)
        return self._known[source]

    def groups(self) -> list[Callable[[], None]]:
        """Return the functions to call once a tick. Each samples the values of one state of one
        vehicle, so that the state is checked only once."""
        return [
            _group(
                self._views[vehicle] if vehicle is not None else None,
                state,
                [sampler.sample for sampler in samplers],
            )
            for (vehicle, state), samplers in self._by_state.items()
        ]


class _Sampler:
    """Adds a value to its statistics in each tick, unless the value is unavailable."""

    def __init__(
        self, read: Callable[[], float], flies: Callable[[], bool], statistics: _Statistics
    ) -> None:
        self.statistics = statistics
        self._read, self._flies = read, flies
        self._add = self.statistics.add

    def sample(self) -> None:
        try:
            self._add(self._read())
        except Unavailable:
            self.statistics.unknown += self._flies()


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
