"""Options: applied at the next tick, bounded, typed; a refusal says why and changes nothing. Safety
parameters: every one says how it tightens, and in flight they do nothing else."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal

import numpy as np
import pytest
from plans import vehicle
from short_flights import down, hold, named, up

from kybflow.core.errors import OptionRefused
from kybflow.core.params import param, params
from kybflow.core.signals import Event
from kybflow.core.units import Damping, Matrix
from kybflow.parts.catalog import PartSpec, load_catalog
from kybflow.runtime.events import Events
from kybflow.runtime.options import Options

CATALOG = load_catalog()
NAME = "mk.processors.limit_speed.speed"
OBSTACLES = "mk.processors.avoid_obstacles.treat_as_obstacles"
MARGIN = "mk.supervisors.fence.margin"
GAIN, LIMIT = "mk.trackers.cascade.position_gain", "mk.supervisors.coupled.limit"
TEXT = "[[1, 0, 0], [0, 1, 0], [0, 0, 1]]"
ONE = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@params
class CoupledParams:
    limit: Matrix[Literal[2], Literal[2], Damping] = param(
        "How fast each may answer the other.", default=((2.0, 1.0), (1.0, 2.0)), tightens="down"
    )


class Holder:
    """A vehicle with parts of the catalog; it flies if a test says so."""

    name, airborne = "mk", False

    def __init__(self) -> None:
        parts = (
            ("drivers", "sim"), ("processors", "limit_speed"), ("processors", "avoid_obstacles"),
            ("supervisors", "fence"), ("trackers", "cascade"),
        )  # fmt: skip
        self.params = {f"{kind}.{name}": CATALOG.get(kind, name).params() for kind, name in parts}
        self.params["supervisors.coupled"] = CoupledParams()

    def parameters(self) -> dict[str, Any]:
        return self.params

    def change(self, label: str, name: str, value: Any) -> None:
        self.params[label] = replace(self.params[label], **{name: value})


@pytest.fixture
def holder() -> Holder:
    return Holder()


@pytest.fixture
def told() -> list[Event]:
    return []


@pytest.fixture
def options(holder: Holder, told: list[Event]) -> Options:
    return Options({holder.name: holder}, Events((told.append,)))


def test_a_change_takes_effect_when_the_next_tick_begins(options, told):
    options.set(NAME, "50 cm/s", by="test")
    assert options.get(NAME) == 1.0
    options.apply()
    assert options.get(NAME) == 0.5
    assert told[-1].name == "option_changed"
    assert told[-1].fields["by"] == "test"


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        (NAME, "-1 m/s", "must be above 0"),
        (NAME, "2 kg", "is a mass, but a speed is needed"),
        (NAME, "fast", "is not a speed"),
        ("mk.processors.limit_speed.spede", "1", "did you mean `mk.processors.limit_speed.speed`"),
        ("mk.processors.unknown.speed", "1", "there is no option"),
        ("other.processors.limit_speed.speed", "1", "there is no option"),
        ("mk.drivers.sim.physics", "400 Hz", "is read-only"),
    ],
)
def test_a_refused_change_says_why_and_changes_nothing(options, told, name, value, reason):
    with pytest.raises(OptionRefused, match=reason):
        options.set(name, value, by="test")
    options.apply()
    assert options.get(NAME) == 1.0
    assert [e.name for e in told] == ["option_refused"]
    assert reason in str(told[0].fields["reason"])


@pytest.mark.parametrize(("value", "names"), [("[mk]", ("mk",)), ("[]", ()), (("mk",), ("mk",))])
def test_names_of_vehicles_are_a_list(options, value, names):
    options.set(OBSTACLES, value, by="test")
    options.apply()
    assert options.get(OBSTACLES) == names


def test_a_vehicle_that_is_not_there_is_refused(options, told):
    with pytest.raises(OptionRefused, match="there is no vehicle `nobody`"):
        options.set(OBSTACLES, "[mk, nobody]", by="test")
    assert told[-1].name == "option_refused"


@pytest.mark.parametrize("value", ["[", "", ",", "[mk", "[[mk]]", "{mk: mk}"])
def test_half_a_list_of_names_is_no_empty_one(options, told, value):
    with pytest.raises(
        OptionRefused, match=r"must be a list of names|never closed|there is nothing"
    ):
        options.set(OBSTACLES, value, by="test")
    assert told[-1].name == "option_refused"


@pytest.mark.parametrize(
    "value", [TEXT, " [ [1,0,0],[0 , 1, 0], [0,0, 1.0] ] ", ONE, [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
              np.eye(3)],
)  # fmt: skip
def test_a_matrix_is_set_as_text_or_as_rows_of_numbers(options, told, value) -> None:
    assert options.get(GAIN) is None
    options.set(GAIN, value, by="test")
    options.apply()
    assert options.get(GAIN) == ONE
    assert told[-1].name == "option_changed"


def test_the_numbers_of_a_matrix_have_units(options) -> None:
    options.set(LIMIT, "[[1 1/s, 0.5], [0.5 1/s, 1]]", by="test")
    options.apply()
    assert options.get(LIMIT) == ((1.0, 0.5), (0.5, 1.0))


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        (GAIN, "[[1, 0, 0], [0, 1, 0]]", "`[[...], ...]`, but this is a list of 2"),
        (GAIN, "[[1, 0, 0]]", "`[[...], ...]`, but this is a list with one element"),
        (GAIN, "[[1, 0], [0, 1, 0], [0, 0, 1]]", "3 rows of 3 numbers, but this is a row of 2"),
        (GAIN, [[1, 0, 0], [0, 1, 0], [0, 0, 1, 0]], "of 3 numbers, but this is a row of 4"),
        (GAIN, "[[1, 0, 0], [0, , 0], [0, 0, 1]]", "there is nothing before this `,`"),
        (GAIN, "1", "`[[...], ...]`, but this is a list with one element"),
        (GAIN, 1.0, "`[[...], ...]`, but this is the number `1.0`"),
        (GAIN, [1.0, 0.0, 0.0], "must be 3 rows of 3 numbers, but this is the number `1.0`"),
        (GAIN, None, "must be 3 rows of 3 numbers, `[[...], ...]`, but this is the text `None`"),
        (GAIN, [[1, 0, 0], [0, None, 0], [0, 0, 1]], "`None` is not a number"),
        (GAIN, [[1, 0, 0], [0, [1], 0], [0, 0, 1]], "a number is needed, but this is a list"),
        (GAIN, "[[1, 0, 0], [0, one, 0], [0, 0, 1]]", "`one` is not a number"),
        (GAIN, "[[1, 0, 0], [0, 1 m, 0], [0, 0, 1]]", "`1 m` is a length, but a number is needed"),
        (GAIN, "[[1, 0, 0], [0, 101, 0], [0, 0, 1]]", "at most 100, not `101`"),
        (GAIN, [[1, 0, 0], [0, float("nan"), 0], [0, 0, 1]], "`nan` is not a number"),
        (GAIN, [[1, 0, 0], [0, float("inf"), 0], [0, 0, 1]], "`inf` is not a number"),
        (GAIN, "[[1, 2, 0], [0, 1, 0], [0, 0, 1]]", "must be symmetric, but row 1 has 2"),
        (GAIN, "[[1, 2, 0], [2, 1, 0], [0, 0, 1]]", "must be positive definite"),
        (LIMIT, "[[1, 0, 0], [0, 1, 0]]", "must be 2 rows of 2 numbers, but this is a row of 3"),
    ],
)
def test_a_wrong_matrix_is_refused_with_the_reason(options, told, name, value, reason) -> None:
    before = options.get(name)
    with pytest.raises(OptionRefused) as refusal:
        options.set(name, value, by="test")
    assert reason in str(refusal.value)
    options.apply()
    assert options.get(name) == before
    assert [event.name for event in told] == ["option_refused"]


@pytest.mark.parametrize(
    ("value", "is_refused"),
    [("[[1, 1], [1, 1]]", False), ("[[1, 1], [1, 2.5]]", True), ("[[2, 1.5], [0, 2]]", True)],
)
def test_in_flight_each_number_of_a_safety_parameter_only_tightens(
    holder, options, told, value, is_refused
) -> None:
    holder.airborne = True
    if is_refused:
        with pytest.raises(OptionRefused, match="in flight it only becomes smaller"):
            options.set(LIMIT, value, by="test")
    else:
        options.set(LIMIT, value, by="test")
    options.apply()
    [event] = told
    assert event.name == ("option_refused" if is_refused else "option_changed")


@pytest.mark.thorough
def test_a_matrix_is_set_when_a_run_begins(run) -> None:
    plan = vehicle("mk", [up("hold"), hold(1.0, "down"), down()])
    _, told = run(plan, options=((GAIN, TEXT.replace("1", "8")),))
    [changed] = named(told, "option_changed")
    assert changed.fields["option"] == GAIN
    assert named(told, "option_refused") == []


def safety_parts() -> list[Any]:
    specs = [CATALOG.get("supervisors", name) for name in CATALOG.names("supervisors")]
    processors = (CATALOG.get("processors", name) for name in CATALOG.names("processors"))
    specs += [spec for spec in processors if spec.cls.safety]
    return [pytest.param(spec, id=f"{spec.kind}/{spec.name}") for spec in specs]


@pytest.mark.parametrize("spec", safety_parts())
def test_every_parameter_of_a_safety_part_only_tightens_or_is_read_only(spec: PartSpec):
    loose = [f.name for f in spec.fields if f.tightens is None and not f.read_only]
    assert loose == []


@pytest.mark.parametrize("name", CATALOG.names("supervisors"))
def test_every_supervisor_has_a_reaction(name: str):
    [reaction] = (f for f in CATALOG.get("supervisors", name).fields if f.name == "reaction")
    assert reaction.choices == ("warn", "brake", "go_home", "land", "land_blind", "cut")


CHANGES = [
    ("a.supervisors.fence.margin", "0.05", "0.2", "smaller"),
    ("a.supervisors.battery.land_below", "0.2", "0.1", "greater"),
    ("a.supervisors.fence.reaction", "land_blind", "brake", "stricter"),
    ("a.processors.fence.margin", "0.3", "0.1", "greater"),
]


def test_in_flight_a_safety_parameter_only_tightens(run):
    refused: list[str] = []

    def change(engine):
        if engine.seconds() < 5.0 or refused:
            return
        for name, tighter, looser, _ in CHANGES:
            engine.options.set(name, tighter, "test")
            with pytest.raises(OptionRefused) as refusal:
                engine.options.set(name, looser, "test")
            refused.append(str(refusal.value))

    plan = vehicle("a", [up("hold"), hold(4.0, "down"), down()])
    _, told = run(plan, observers=(change,))
    because = [
        f"`{name}` is a safety parameter: in flight it only becomes {word}"
        for name, _, _, word in CHANGES
    ]
    assert refused == because
    assert [e.fields["reason"] for e in named(told, "option_refused")] == because
    changed = [e.fields["option"] for e in named(told, "option_changed")]
    assert changed == [name for name, _, _, _ in CHANGES]


UNSTABLE = ("a.trackers.cascade.proportional", "900", "would make `a` oscillate")


def test_a_gain_that_the_compiler_refuses_is_refused_before_the_flight(run):
    name, value, reason = UNSTABLE
    with pytest.raises(OptionRefused, match=reason):
        run(vehicle("a", [up("down"), down()]), options=((name, value),))


def test_a_gain_that_the_compiler_refuses_is_refused_in_flight(run):
    name, value, reason = UNSTABLE
    answers: list[str] = []

    def change(engine):
        if engine.seconds() > 2.0 and not answers:
            engine.options.set(name, "12", "test")
            with pytest.raises(OptionRefused) as refusal:
                engine.options.set(name, value, "test")
            answers.append(str(refusal.value))

    _, told = run(vehicle("a", [up("hold"), hold(4.0, "down"), down()]), observers=(change,))
    [answer] = answers
    assert reason in answer
    assert [e.fields["value"] for e in named(told, "option_changed")] == ["12.0"]
    assert [e.fields["reason"] for e in named(told, "option_refused")] == answers


def test_on_the_ground_anything_in_bounds_goes(run):
    plan = vehicle("a", [up("down"), down()])
    changes = [(name, value) for name, *values, _ in CHANGES for value in values]
    _, told = run(plan, options=tuple(changes))
    assert [e.fields["option"] for e in named(told, "option_changed")] == [n for n, _ in changes]
    assert named(told, "option_refused") == []


def test_a_change_that_a_take_off_overtakes_is_refused_when_it_is_due(holder, options, told):
    options.set(MARGIN, "1 m", "test")
    holder.airborne = True
    options.apply()
    assert options.get(MARGIN) == 0.1
    assert [e.name for e in told] == ["option_refused"]
