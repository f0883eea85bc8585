"""Random flights with faults: a mission, a target and what breaks, all drawn from one number.

`draw` writes a mission of the repository anew: with its own faults or without, sometimes with a
long hover after take-off or a second estimator, and with faults of the catalog. A fault is drawn by
what it declares: a choice among its words, a number between its bounds and around its default, or
of the size of its dimension. A new fault, a new mission and a new state are drawn without an edit.

Four scenarios break what labs break: `frame` declares motion capture wrongly, from the start or in
flight; `lift` breaks something in the first decimetres of a take-off; `fleet` breaks the same thing
on every vehicle at once; `people` gives commands, most of them in a hurry, beside a fault.
"""

from __future__ import annotations

import random
from collections.abc import Iterator, Sequence
from math import exp, log, pi
from pathlib import Path
from typing import NamedTuple

import yaml
from toolchain import SHIPPED

from kybflow.core.params import Field
from kybflow.core.signals import NS
from kybflow.core.units import ANGLE
from kybflow.dsl.compiler import compile_mission
from kybflow.dsl.plan import Plan, VehiclePlan
from kybflow.parts import AIR, GROUND
from kybflow.parts.catalog import PartSpec, load_catalog
from kybflow.runtime.commanding.command_queue import RecordedCommand

TARGETS = ("sim", "sim", "emulated_px4", "emulated_ardupilot", "emulated_ardrone")
SCENARIOS = (
    "pair", "chatter", "landing", "late", "strong", "many", "frame", "lift", "fleet", "people",
)  # fmt: skip
_LIFTED = ("mocap_frame", "clock_late", "link_cut", "rotor_weak", "mass_change", "push")
_SIZES = {
    "number": 1.0, "length": 0.3, "speed": 1.2, "acceleration": 0.2, "angle": 0.05,
    "angular rate": 0.01, "duration": 0.3, "mass": 0.03, "ratio": 0.3, "force": 1.0, "torque": 0.2,
}  # fmt: skip
"""What is drawn, in SI, where a fault declares neither a default nor two bounds."""
_SPREAD, _STRONG = 3.0, 8.0
"""The largest factor on such a size or a default, up or down; and up, where it is strong."""
_ESTIMATORS = (
    "[{use: mocap, healthy: age < 250 ms and spread < 5 cm, recover_after: 1 s},"
    " {use: inertial, healthy: spread < 30 cm, for_at_most: 3 s}]",
    "[{use: fusion, healthy: age < 250 ms and spread < 5 cm, recover_after: 1 s},"
    " {use: inertial, healthy: spread < 30 cm, for_at_most: 3 s}]",
    "[{use: fusion, healthy: age < 250 ms and spread < 5 cm, recover_after: 1 s}]",
)
_FAILSAFE = ("brake", "auto_land", "land_blind")
_TRIES = 50
_CHEAP = 1.0
"""What costs more than so many vehicles is drawn the more rarely."""


class Drawn(NamedTuple):
    """A flight that was drawn. hover: the seconds that were added after take-off. faults: the lines
    of `faults:` that were added. path: the mission, which has been written there. plan: it is
    valid. commands: what people command."""

    seed: int
    mission: str
    target: str
    scenario: str
    hover: float
    faults: tuple[str, ...]
    path: Path
    plan: Plan
    commands: tuple[RecordedCommand, ...]


def draw(seed: int, folder: Path) -> Drawn:
    """Draw the flight `seed` and write its mission into `folder`, which has the library. What the
    compiler refuses, such as a fault that is written twice, is drawn again."""
    for attempt in range(_TRIES):
        drawn = _drawn(seed, random.Random(f"faults {seed} {attempt}"), folder)
        if drawn is not None:
            return drawn
    raise RuntimeError(f"no valid flight in {_TRIES} attempts for the seed {seed}")


def _drawn(seed: int, rng: random.Random, folder: Path) -> Drawn | None:
    source, target = rng.choice(SHIPPED), rng.choice(TARGETS)
    scenario = rng.choice(SCENARIOS)
    text = yaml.compose(source.read_text(encoding="utf-8"), yaml.SafeLoader)
    hover = rng.uniform(60.0, 150.0) if scenario == "late" else rng.choice((0.0, 0.0, 0.0, 70.0))
    hover = round(hover) if _linger(text, round(hover)) else 0.0
    _thin_out(text, rng)
    if hover:
        _without(text, "expect")  # written for the mission as it was, and too soon now
    path = folder / f"flight{seed}.yaml"
    plan = _written(path, text, target)
    if plan is None or rng.random() * _cost(plan) > _CHEAP:
        return None
    faults = tuple(faults_of(rng, plan, scenario, hover))
    _extend(text, "faults", [yaml.compose(line, yaml.SafeLoader) for line in faults])
    plan = _written(path, text, target)
    if plan is None:
        return None
    commands = tuple(_commands(rng, plan)) if scenario == "people" else ()
    return Drawn(seed, source.stem, target, scenario, hover, faults, path, plan, commands)


def _commands(rng: random.Random, plan: Plan) -> Iterator[RecordedCommand]:
    """Draw what two people command; what the run refuses changes nothing."""
    heard = rng.uniform(1.0, 12.0)
    for _ in range(rng.randint(1, 5)):
        vehicle = rng.choice(plan.vehicles)
        states = [name for name, state in vehicle.states.items() if not state.built_in]
        texts = (
            f"land {vehicle.name}", "land", f"pause {vehicle.name}", "pause", "resume", "stop",
            f"switch {vehicle.name} {rng.choice(states)}", f"reset {vehicle.name}",
        )  # fmt: skip
        yield RecordedCommand(round(heard * NS), rng.choice(texts), rng.choice("ab"), True)
        heard += _between(rng, 0.02, 8.0)


def _cost(plan: Plan) -> float:
    """About how long a flight takes to fly, in vehicles; one with cameras counts for three."""
    return float(sum(3 if vehicle.cameras else 1 for vehicle in plan.vehicles))


def _written(path: Path, text: yaml.MappingNode, target: str) -> Plan | None:
    path.write_text(yaml.serialize(text, Dumper=yaml.SafeDumper, width=1000), encoding="utf-8")
    return compile_mission(path, catalog=load_catalog(), target=target).plan


def _value(mapping: yaml.Node | None, key: str) -> yaml.Node | None:
    found = mapping.value if isinstance(mapping, yaml.MappingNode) else []
    return next((value for name, value in found if name.value == key), None)


def _without(mapping: yaml.MappingNode, key: str) -> None:
    mapping.value = [pair for pair in mapping.value if pair[0].value != key]


def _set(mapping: yaml.MappingNode, key: str, text: str) -> None:
    _without(mapping, key)
    value = yaml.compose(text, yaml.SafeLoader)
    mapping.value.append((yaml.ScalarNode("tag:yaml.org,2002:str", key), value))


def _extend(mapping: yaml.MappingNode, key: str, more: list[yaml.Node]) -> None:
    if _value(mapping, key) is None:
        _set(mapping, key, "[]")
    found = _value(mapping, key)
    assert found is not None
    found.value = [*found.value, *more]
    found.flow_style = False  # a line each: events name a fault by its line


def _vehicles(text: yaml.MappingNode) -> list[yaml.MappingNode]:
    vehicles = _value(text, "vehicles")
    assert vehicles is not None
    return [vehicle for _, vehicle in vehicles.value]


def _linger(text: yaml.MappingNode, seconds: float) -> bool:
    """Let every vehicle hover so long after its take-off; say whether any does. Aliases are one
    node, which is changed once."""
    if not seconds:
        return False
    found = False
    for vehicle in _vehicles(text):
        states = _value(vehicle, "behaviors")
        for _, state in [*states.value] if isinstance(states, yaml.MappingNode) else []:
            do, then = _value(state, "do"), _value(state, "then")
            if do is None or do.value != "take_off" or then is None or then.value == "hover":
                continue
            found = True
            if then.value != "linger":
                goes = f"{{do: hover, for_time: {seconds} s, then: {then.value}}}"
                _set(states, "linger", goes)
                _set(state, "then", "linger")
    return found


def _thin_out(text: yaml.MappingNode, rng: random.Random) -> None:
    """Mostly leave the expectations away, which faults break, and sometimes the own faults; give
    vehicles that have none their own estimators now and then."""
    if rng.random() < 0.75:
        _without(text, "expect")
    if rng.random() < 0.3:
        _without(text, "faults")
    estimators = rng.choice((None, None, None, *_ESTIMATORS))
    for vehicle in _vehicles(text) if estimators else []:
        like = _value(vehicle, "like")
        plain = like is not None and like.value in ("std.nano_plus", "std.mk_quadro")
        if plain and _value(vehicle, "estimators") is None:
            _set(vehicle, "estimators", estimators)


def faults_of(rng: random.Random, plan: Plan, scenario: str, hover: float = 0.0) -> Iterator[str]:
    """Draw the faults of one flight, as lines of `faults:`."""
    return _Draw(rng, plan, scenario, hover).faults()


class _Draw:
    """Draws the faults of one flight."""

    def __init__(self, rng: random.Random, plan: Plan, scenario: str, hover: float) -> None:
        self._rng, self._plan, self._hover = rng, plan, hover
        self._scenario = scenario
        self._strong = scenario == "strong"

    def faults(self) -> Iterator[str]:
        rng, scenario = self._rng, self._scenario
        vehicle = rng.choice(self._plan.vehicles)
        when = self._when(vehicle)
        if scenario == "chatter":
            yield from self._chatter(vehicle, when)
            return
        if scenario == "fleet":
            when, fault, lasts = self._when(vehicle), self._fault(vehicle), self._lasts()
            at = when if not when.condition else _When("", rng.uniform(2.0, 25.0 + self._hover))
            for each in self._plan.vehicles:
                yield self._line(each, fault, at, lasts)
            return
        if scenario == "frame":
            when = _When("", 0.0) if rng.random() < 0.5 else when
            yield self._line(vehicle, self._fault(vehicle, ("mocap_frame",)), when, None)
            return
        if scenario == "lift":
            own = [s for s in vehicle.states.values() if not s.built_in]
            takes_off = [
                s.name for s in own if any(g.start is GROUND and g.end is AIR for g in s.legs)
            ]
            height = f"{100.0 * _between(rng, 0.005, 0.8):.3g} cm"
            rises = f"behavior == {rng.choice(takes_off)} and state.altitude > {height}"
            fault, lasts = self._fault(vehicle, _LIFTED), self._lasts()
            yield self._line(vehicle, fault, _When(rises), lasts)
            return
        for number in range(rng.randint(3, 5) if scenario == "many" else rng.randint(1, 2) + 1):
            if number and rng.random() < 0.4:
                when = when.later(rng.uniform(0.0, 3.0))
            elif number:
                vehicle = vehicle if rng.random() < 0.7 else rng.choice(self._plan.vehicles)
                when = self._when(vehicle, number)
            yield self._line(vehicle, self._fault(vehicle), when, self._lasts())

    def _chatter(self, vehicle: VehiclePlan, when: _When) -> Iterator[str]:
        """One fault that comes and goes, and perhaps another that stays."""
        rng, fault = self._rng, self._fault(vehicle)
        on, off = _between(rng, 0.05, 1.5), _between(rng, 0.05, 2.0)
        for _ in range(rng.randint(3, 8)):
            yield self._line(vehicle, fault, when, on * rng.uniform(0.7, 1.3))
            when = when.later(on + off * rng.uniform(0.7, 1.3))
        if rng.random() < 0.5:
            yield self._line(vehicle, self._fault(vehicle), self._when(vehicle, 1), self._lasts())

    def _lasts(self) -> float | None:
        rng = self._rng
        if rng.random() < 0.15:
            return None
        return _between(rng, 0.2, 8.0) if rng.random() < 0.8 else _between(rng, 8.0, 30.0)

    def _line(self, vehicle: VehiclePlan, fault: str, when: _When, lasts: float | None) -> str:
        ends = "" if lasts is None else f", for: {lasts:.2f} s"
        return f"{{{when.text()}, on: {vehicle.name}, {fault}{ends}}}"

    def _when(self, vehicle: VehiclePlan, number: int = 0) -> _When:
        """When a fault begins: the first one by a time or in a state of the mission, later ones
        perhaps in what the failsafe does."""
        rng, share = self._rng, self._rng.random()
        if self._scenario == "late" and number == 0 and self._hover:
            return _When("", rng.uniform(0.6, 1.1) * self._hover + 5.0)
        landing = 0.8 if self._scenario == "landing" else 0.2
        if share < landing:
            states = self._states(vehicle, ends_on_ground=True)
            states += _FAILSAFE[1:] if number else ()
            height = f"{100.0 * _between(rng, 0.02, 1.0):.3g} cm"
            return _When(f"behavior == {rng.choice(states)} and state.altitude < {height}")
        if share < landing + 0.3 * (1.0 - landing):
            return _When("", rng.uniform(2.0, 25.0 + self._hover))
        states = self._states(vehicle, ends_on_ground=False)
        if number and rng.random() < 0.3:
            states = [*_FAILSAFE]
        return _When(f"behavior == {rng.choice(states)}", rng.uniform(0.0, 6.0))

    def _states(self, vehicle: VehiclePlan, ends_on_ground: bool) -> list[str]:
        """The mission's own states that land, or that begin or are in the air."""
        own = [s for s in vehicle.states.values() if not s.built_in]
        lands = [s.name for s in own if any(leg.end is GROUND for leg in s.legs)]
        others = [s.name for s in own if s.name not in lands]
        return (lands if ends_on_ground else others) or [s.name for s in own]

    def _fault(self, vehicle: VehiclePlan, among: Sequence[str] = ()) -> str:
        """`inject: NAME, PARAMETER: VALUE ...` of a fault that this vehicle can have, of those in
        `among` if it can have any of these."""
        rng, catalog = self._rng, load_catalog()
        specs = [catalog.get("faults", name) for name in catalog.names("faults")]
        fitting = [spec for spec in specs if self._fits(spec, vehicle)]
        spec = rng.choice([spec for spec in fitting if spec.name in among] or fitting)
        given = {field.name: self._drawn(field, vehicle) for field in spec.fields}
        parameters = [f"{name}: {value}" for name, value in given.items() if value is not None]
        return ", ".join([f"inject: {spec.name}", *parameters])

    def _fits(self, spec: PartSpec, vehicle: VehiclePlan) -> bool:
        if any(field.names == "vehicle" for field in spec.fields) and len(self._plan.vehicles) < 2:
            return False
        if any(field.names == "object" for field in spec.fields) and not self._moving():
            return False
        parts = [use.part for use in vehicle.estimators]
        return spec.cls.spoils is None or any(
            spec.cls.spoils in part.cls.uses(part.params) for part in parts
        )

    def _moving(self) -> list[str]:
        """The objects that move."""
        return [name for name, one in self._plan.objects.items() if one.moves]

    def _drawn(self, field: Field, vehicle: VehiclePlan) -> str | None:
        """The text of a parameter's value; None for the default."""
        rng = self._rng
        if field.names == "vehicle":
            others = [v.name for v in self._plan.vehicles if v is not vehicle]
            return rng.choice(others)
        if field.names == "object":
            return rng.choice(self._moving())
        if field.names == "estimator":
            return rng.choice([u.part.label.rpartition(".")[2] for u in vehicle.estimators])
        if field.choices:
            return rng.choice(field.choices if field.default else (*field.choices, None, None))
        if field.shape == "vector":
            numbers = [rng.choice((-1.0, 0.0, 1.0)) * self._size(field) + 0.0 for _ in range(3)]
            return "[" + ", ".join(_quantity(field, n) for n in numbers) + "]"
        if field.shape == "scalar":
            return _quantity(field, self._number(field))
        return None

    def _size(self, field: Field) -> float:
        """The size of a number without bounds on both sides: around its default, where that is not
        zero, else around what its dimension says."""
        assert field.dimension is not None
        usual = field.default if isinstance(field.default, float) else 0.0
        if self._scenario == "frame" and field.dimension is ANGLE:
            return pi * self._rng.choice((-0.5, -0.25, 0.0, 0.0, 0.25, 0.5, 1.0))
        usual = abs(usual) or _SIZES[field.dimension.name]
        return usual * (_between(self._rng, 1.0, _STRONG) if self._strong else self._factor())

    def _factor(self) -> float:
        return _between(self._rng, 1.0 / _SPREAD, _SPREAD)

    def _number(self, field: Field) -> float:
        """A number within its bounds: from the default towards one of them, rarely all the way."""
        low = field.above if field.at_least is None else field.at_least
        high = field.below if field.at_most is None else field.at_most
        if low is None or high is None:
            size = self._size(field)
            return max(size, low or 0.0) if high is None else min(size, high)
        usual = field.default if field.default is not None else 0.5 * (low + high)
        rng = self._rng
        part = rng.uniform(0.5, 1.0) if self._strong else rng.uniform(0.0, 0.7)
        [end] = rng.choices((low, high), (usual - low, high - usual))
        return float(usual + part**2 * (0.999 * end - usual))


class _When(NamedTuple):
    """When a fault begins: so many seconds after the run began or, with a condition, in the
    behavior that it names; without `seconds` as soon as it holds."""

    condition: str
    seconds: float | None = None

    def later(self, seconds: float) -> _When:
        """So much later; where the beginning is no time, as late in the behavior."""
        return self._replace(seconds=(self.seconds or 0.0) + seconds)

    def text(self) -> str:
        if not self.condition:
            return f"at: {self.seconds:.2f} s"
        late = "" if self.seconds is None else f" and elapsed > {self.seconds:.2f} s"
        return f"when: {self.condition}{late}"


def _between(rng: random.Random, low: float, high: float) -> float:
    """A number whose logarithm is uniformly distributed."""
    return exp(rng.uniform(log(low), log(high)))


def _quantity(field: Field, value: float) -> str:
    """A value in SI, as it is written in a mission."""
    unit = "" if field.dimension is None or field.dimension.bare_allowed else field.dimension.si
    return f"{value:.4g} {unit}".rstrip()
