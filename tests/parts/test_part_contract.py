"""What every part in the catalog keeps, whatever it does: one contract, no part named in it.

A part with required parameters is built with plausible ones, drawn from their dimensions.
"""

from __future__ import annotations

import json
import math
import random
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import pytest
from part_bench import DT, INPUTS, SITE, WITH_BLOCK, at_rest, entry, estimate, seen_block

from kybflow.core.events import Emitting
from kybflow.core.files import File
from kybflow.core.geometry import GRAVITY, LEVEL, ZERO, Vec3, from_heading
from kybflow.core.params import Field, Numbers
from kybflow.core.signals import (
    NS,
    Alarm,
    Battery,
    Command,
    CommandKind,
    Done,
    Estimate,
    Event,
    Failed,
    Frame,
    Grip,
    Imu,
    Measurement,
    Odometry,
    Pose,
    Retune,
    Setpoint,
    SetpointKind,
    Tick,
)
from kybflow.parts import GROUND, ActionContext, Effect, Footprint
from kybflow.parts.catalog import BASES, PartSpec, load_catalog
from kybflow.runtime.finite import checked_command

CATALOG = load_catalog()
HEAVY = ("numpy", "scipy", "mujoco", "transitions", "cv2", "plotly", "foxglove", "pymavlink")
TICKS = 200
CONTEXT = frozenset(name for name in vars(ActionContext) if not name.startswith("_"))
START: Vec3 = (0.1, 0.2, 1.0)
TABLE = File("table.csv", "", "t, x, y, z\n0, 0.1, 0.2, 1\n2, 0.5, 0.5, 1.2\n4, 0.5, 0.2, 1\n")
PLAUSIBLE = {"length": 1.0, "duration": 8.0, "position": (0.5, 0.5, 1.2)}


def specs(*kinds: str) -> list[Any]:
    """A test parameter for every part of these kinds (of all, when none is given)."""
    chosen = kinds or CATALOG.kinds()
    names = [(kind, name) for kind in chosen for name in CATALOG.names(kind)]
    return [pytest.param(CATALOG.get(*key), id="/".join(key)) for key in names]


def minimal(spec: PartSpec) -> Any:
    """Its parameters, with a plausible value for those that have no default."""
    return spec.params(**{f.name: plausible(f) for f in spec.fields if f.required})


def plausible(field: Field) -> Any:
    if field.names == "object":
        return "block"
    if field.key == "surface":
        return "block.back"
    if field.shape == "path":
        return ((0.5, 0.0, 1.0), (0.5, 0.5, 1.2))
    if field.shape == "vector":
        return PLAUSIBLE["position"]
    if field.shape in ("scalar", "integer"):
        value = PLAUSIBLE.get(field.dimension.name if field.dimension else "", 1.0)
        return int(value) if field.shape == "integer" else value
    if field.shape == "file":
        return TABLE
    return {"choice": field.choices[:1], "boolean": (True,), "text": ("a",)}[field.shape][0]


def numbers(value: Any) -> Iterator[float]:
    """Every number in a value, however deep."""
    if isinstance(value, float | int):
        yield value
    elif isinstance(value, tuple):
        for item in value:
            yield from numbers(item)


def ticks(setpoint: Setpoint | None = None, where: Vec3 = START) -> Iterator[Tick]:
    """A flight past a place with a little noise, the same in every test."""
    generator = random.Random(7)
    for i in range(TICKS):
        position = tuple(x + generator.gauss(0.0, 0.001) for x in where)
        velocity = tuple(generator.gauss(0.0, 0.02) for _ in range(3))
        known = estimate(position, velocity, now=i * round(DT * NS))
        battery = Battery(known.time, 1.0 - 0.005 * i, 12.0)
        fleet = {"nano": known}
        yield Tick(
            known.time, DT, i * DT, known, battery, setpoint, fleet, inputs=INPUTS,
            objects=seen_block(now=known.time),
        )  # fmt: skip


def path(i: int, kind: SetpointKind) -> Setpoint:
    """A setpoint on a slow circle, with what its kind must have."""
    phase = 0.5 * i * DT
    position = (START[0] + 0.2 * math.sin(phase), START[1], START[2])
    velocity = (0.1 * math.cos(phase), 0.0, 0.0)
    full = at_rest(position, velocity)._replace(kind=kind)
    if kind is SetpointKind.POSITION:
        return full
    return full._replace(
        position=None, velocity=None if kind is SetpointKind.ACCELERATION else velocity
    )


def same_twice(make: Any, run: Any) -> list[Any]:
    """The outputs of `run` on a fresh part, after checking that a second fresh one gives the same
    and that every number is finite."""
    first, second = run(make()), run(make())
    assert first == second
    assert all(math.isfinite(number) for number in numbers(tuple(first)))
    return first


@pytest.mark.parametrize("spec", specs())
def test_it_is_documented(spec: PartSpec) -> None:
    assert 20 <= len(spec.summary) <= 100
    assert spec.summary.rstrip().endswith((".", ","))
    assert len(spec.doc.strip().splitlines()) >= 3
    name = "".join(word.capitalize() for word in spec.name.split("_"))
    assert spec.cls.__name__ in (name, f"{name}{BASES[spec.kind].__name__}")
    assert spec.params.__name__ == f"{spec.cls.__name__}Params"


@pytest.mark.parametrize("spec", specs())
def test_every_parameter_has_help_a_unit_and_a_valid_default(spec: PartSpec) -> None:
    for field in spec.fields:
        assert field.help[0].isupper(), field.name
        assert field.help.endswith("."), field.name
        assert (field.dimension is not None) == isinstance(field.type, Numbers)
        if field.required or field.default is None:
            assert field.required or field.optional, field.name
            continue
        for number in numbers(field.default):
            assert field.is_within(number), field.name
        assert not field.choices or field.default in field.choices, field.name


@pytest.mark.parametrize("spec", specs())
def test_it_is_made_with_its_parameters_and_keeps_them(spec: PartSpec) -> None:
    params = minimal(spec)
    assert params == minimal(spec)
    assert hash(params) == hash(minimal(spec))


def test_no_part_imports_anything_heavy() -> None:
    modules = [
        CATALOG.get(kind, name).cls.__module__
        for kind in CATALOG.kinds()
        for name in CATALOG.names(kind)
    ]
    program = (
        "import importlib, json, sys\n"
        f"for name in {modules!r}: importlib.import_module(name)\n"
        f"print(json.dumps([m for m in {HEAVY!r} if m in sys.modules]))"
    )
    result = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=300
    )
    assert json.loads(result.stdout) == []


def begun(spec: PartSpec) -> Any:
    flight = spec.cls.flight[0].start
    where = (0.0, 0.0, 0.0) if flight is GROUND else START
    return spec.cls(minimal(spec), entry(where, flight=flight, context=WITH_BLOCK))


@pytest.mark.parametrize("spec", specs("behaviors"))
def test_a_behavior_is_deterministic_and_finite_and_emits_what_it_says(spec: PartSpec) -> None:
    def run(behavior: Any) -> list[Any]:
        return [behavior.update(tick) for tick in ticks()]

    for output in same_twice(lambda: begun(spec), run):
        assert not isinstance(output, Grip) or spec.cls.grips
        if isinstance(output, Emitting):
            assert type(output.event) in spec.cls.own_events
        own = output.output if isinstance(output, Emitting) else output
        given = own.setpoint if isinstance(own, Done | Failed | Grip) else own
        if isinstance(given, Command):
            assert spec.cls.emits is CommandKind.ATTITUDE_THRUST
            continue
        assert given.kind in (spec.cls.emits, SetpointKind.IDLE)
        if given.kind is SetpointKind.POSITION:
            assert None not in (given.position, given.velocity, given.acceleration, given.heading)


@pytest.mark.parametrize("spec", specs("behaviors"))
def test_a_behavior_begins_where_it_is_entered(spec: PartSpec) -> None:
    where = (0.0, 0.0, 0.0) if spec.cls.flight[0].start is GROUND else START
    output = begun(spec).update(next(ticks(where=where)))
    given = output.setpoint if isinstance(output, Done | Failed | Grip) else output
    if isinstance(given, Setpoint) and given.position is not None:
        assert given.position == pytest.approx(where, abs=0.001)


@pytest.mark.parametrize("spec", specs("behaviors"))
def test_a_behavior_that_needs_no_estimate_works_without_one(spec: PartSpec) -> None:
    if spec.cls.needs_estimate:
        return
    behavior = begun(spec)
    for tick in ticks():
        behavior.update(tick._replace(estimate=None, fleet={"nano": None}))


@pytest.mark.parametrize("spec", specs("behaviors"))
def test_a_footprint_is_finite_and_begins_at_the_entry(spec: PartSpec) -> None:
    params = minimal(spec)
    for where in (None, START):
        footprint = spec.cls.footprint(params, where)
        assert footprint is None or isinstance(footprint, Footprint)
        if footprint is not None:
            assert footprint.speed >= 0.0
            assert where is None or where in footprint.points
            assert all(math.isfinite(number) for number in numbers(footprint.points))


@pytest.mark.parametrize("spec", specs("behaviors"))
def test_no_behavior_ends_before_the_least_time_of_its_footprint(spec: PartSpec) -> None:
    where = (0.0, 0.0, 0.0) if spec.cls.flight[0].start is GROUND else START
    footprint = spec.cls.footprint(minimal(spec), where)
    if footprint is None or footprint.is_endless:
        return
    behavior, position, velocity = begun(spec), where, ZERO
    for i in range(30 * round(1 / DT)):
        known = estimate(position, velocity, now=i * round(DT * NS))
        output = behavior.update(Tick(known.time, DT, i * DT, known, None, None, {"nano": known}))
        if isinstance(output, Done | Failed):
            assert isinstance(output, Failed) or i * DT >= footprint.least_time(where) - DT
            return
        given = output.setpoint if isinstance(output, Grip) else output
        if isinstance(given, Setpoint):
            velocity = given.velocity or ZERO
            x, y, z = given.position or tuple(
                p + v * DT for p, v in zip(position, velocity, strict=True)
            )
            position = (x, y, max(z, 0.0))


@pytest.mark.parametrize("spec", specs("processors"))
def test_a_processor_is_deterministic_and_finite_and_returns_what_it_says(spec: PartSpec) -> None:
    for kind, returned in spec.cls.accepts.items():

        def run(processor: Any, kind: SetpointKind = kind) -> list[Any]:
            return [processor(path(i, kind), tick) for i, tick in enumerate(ticks())]

        for output in same_twice(lambda: spec.cls(minimal(spec), SITE), run):
            assert isinstance(output, Alarm) or bent(spec, output).kind is returned


def bent(spec: PartSpec, output: Setpoint | Retune) -> Setpoint:
    """The setpoint that a processor gives; what it retunes besides, it declares."""
    if not isinstance(output, Retune):
        return output
    assert output.options.keys() <= spec.cls.retunes
    return output.output


@pytest.mark.parametrize("spec", specs("processors"))
def test_a_processor_leaves_a_harmless_setpoint_alone(spec: PartSpec) -> None:
    for kind in spec.cls.takes(minimal(spec)):
        processor = spec.cls(minimal(spec), SITE)
        asked = [path(i, kind) for i in range(TICKS)]
        given = [bent(spec, processor(s, t)) for s, t in zip(asked, ticks(), strict=True)]
        assert all(g is a for g, a in zip(given, asked, strict=True))


@pytest.mark.parametrize("spec", specs("trackers"))
def test_a_tracker_is_deterministic_and_finite_and_gives_what_it_says(spec: PartSpec) -> None:
    for kind in spec.cls.accepts:

        def run(tracker: Any, kind: SetpointKind = kind) -> list[Any]:
            return [tracker.update(path(i, kind), tick) for i, tick in enumerate(ticks())]

        for command in same_twice(lambda: spec.cls(minimal(spec), SITE), run):
            assert isinstance(command, Command)
            assert command.kind in spec.cls.kinds(minimal(spec))
            assert checked_command(command) is command
            assert 0.0 <= command.thrust <= SITE.airframe.max_thrust
            assert sum(x * x for x in command.attitude) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("spec", specs("supervisors"))
def test_a_supervisor_is_deterministic_and_is_silent_about_a_good_flight(spec: PartSpec) -> None:
    def run(supervisor: Any) -> list[Any]:
        return [supervisor.check(tick, True) for tick in list(ticks())[:100]]

    assert same_twice(lambda: spec.cls(minimal(spec), SITE), run) == [None] * 100


@pytest.mark.parametrize("spec", specs("supervisors"))
def test_a_supervisor_bears_a_vehicle_that_reports_nothing(spec: PartSpec) -> None:
    silent = Tick(0, DT, 0.0, None, None, None, {"nano": None})
    supervisor = spec.cls(minimal(spec), SITE)
    assert supervisor.check(silent, False) is None
    alarm = supervisor.check(silent, True)
    assert alarm is None or (isinstance(alarm, Alarm) and math.isfinite(alarm.value))


@pytest.mark.parametrize("spec", specs("estimators"))
def test_an_estimator_is_deterministic_and_finite(spec: PartSpec) -> None:
    assert all(kind._fields[0] == "time" for kind in spec.cls.needs)

    def run(estimator: Any) -> list[Any]:
        generator = random.Random(3)
        estimates: list[Estimate | None] = []
        for i in range(TICKS):
            now = i * round(DT * NS)
            position = tuple(x + generator.gauss(0.0, 0.0005) for x in START)
            felt = (generator.gauss(0.0, 0.1), 0.0, GRAVITY)
            measured: list[Measurement] = [Imu(now, DT, felt, ZERO)]
            if i % 2:
                measured.append(Pose(now, position, from_heading(0.1)))
                measured.append(Odometry(now, position, ZERO, from_heading(0.1), ZERO, 0.001))
            estimates.append(estimator.update(measured, now))
            estimator.anchor(Estimate(now, position, ZERO, LEVEL, ZERO, "another", 0.0, 0.001))
        return estimates

    estimates = same_twice(lambda: spec.cls(minimal(spec), SITE), run)
    assert estimates[0] is None
    if Frame in spec.cls.uses(minimal(spec)):  # there are no tags in this world
        assert set(estimates) == {None}
        return
    assert estimates[-1] is not None
    assert estimates[-1].position == pytest.approx(START, abs=0.01)
    assert estimates[-1].velocity == pytest.approx(ZERO, abs=0.5)


@pytest.mark.parametrize("spec", specs("drivers"))
def test_a_driver_says_what_it_takes_and_gives(spec: PartSpec) -> None:
    assert spec.cls.accepts <= frozenset(CommandKind)
    assert all(kind._fields[0] == "time" for kind in spec.cls.provides)
    assert spec.cls.accepts
    assert spec.cls.provides
    rate = spec.cls.step_rate(minimal(spec))
    assert rate is None or rate > 0.0
    assert spec.cls.takes(minimal(spec)) <= spec.cls.accepts
    rate = spec.cls.control_rate(minimal(spec))
    assert 50 <= rate <= 1000
    tracker = spec.cls.tracker(minimal(spec))
    assert tracker is None or tracker["use"] in CATALOG.names("trackers")


@pytest.mark.parametrize("spec", specs("drivers"))
def test_the_targets_of_a_driver_are_parameters_that_it_has(spec: PartSpec) -> None:
    fields = {field.name: field for field in spec.fields}
    for values in spec.cls.targets.values():
        for name, value in values.items():
            field = fields[name]
            assert isinstance(value, bool) == (field.shape == "boolean")
            assert not field.choices or value in field.choices
        assert all(field.name in values for field in spec.fields if field.required)


@pytest.mark.parametrize("spec", specs("faults"))
def test_a_fault_breaks_the_vehicle_that_it_is_on_and_is_fixed_in_flight(spec: PartSpec) -> None:
    fault = spec.cls(minimal(spec), random.Random(1))
    effects = fault.effects("nano")
    named = [f for f in spec.fields if f.names == "object" and f.required]
    assert ("block" if named else "nano") in effects
    assert all(isinstance(effect, Effect) for effect in effects.values())
    assert all(field.read_only for field in spec.fields)


class Notes:
    """An action context that notes what it is asked for."""

    def __init__(self) -> None:
        self.asked: list[tuple[Any, ...]] = []

    def __getattr__(self, name: str) -> Any:
        assert name in CONTEXT, f"an action context has no `{name}`"
        return lambda *words: self.asked.append((name, *words))


@pytest.mark.parametrize("spec", specs("actions"))
def test_an_action_is_deterministic_and_emits_what_it_says(spec: PartSpec) -> None:
    def run(action: Any) -> list[Any]:
        notes = Notes()
        for i in range(TICKS):
            action(Event(i, "behavior_ended", "nano", {"behavior": "up", "how": "done"}), notes)
            action(Event(i, "run_started", "", {}), notes)
        return notes.asked

    asked = same_twice(lambda: spec.cls(minimal(spec)), run)
    assert {words[1] for words in asked if words[0] == "emit"} <= set(spec.cls.events)
