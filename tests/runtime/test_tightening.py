"""Safety parameters: every one says how it tightens, and in flight they do nothing else."""

from __future__ import annotations

from typing import Any

import pytest
from plans import vehicle
from short_flights import down, hold, named, up

from kybflow.core.errors import OptionRefused
from kybflow.parts.catalog import PartSpec, load_catalog
from kybflow.runtime.events import Events
from kybflow.runtime.options import Options

CATALOG = load_catalog()


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


def test_on_the_ground_anything_in_bounds_goes(run):
    plan = vehicle("a", [up("down"), down()])
    changes = [(name, value) for name, *values, _ in CHANGES for value in values]
    _, told = run(plan, options=tuple(changes))
    assert [e.fields["option"] for e in named(told, "option_changed")] == [n for n, _ in changes]
    assert named(told, "option_refused") == []


class Grounded:
    """A vehicle that takes off when the test says so."""

    name, airborne = "a", False

    def __init__(self) -> None:
        spec = CATALOG.get("supervisors", "fence")
        self.params: dict[str, Any] = {"supervisors.fence": spec.params()}

    def parameters(self) -> dict[str, Any]:
        return self.params

    def change(self, label: str, parameters: Any) -> None:
        self.params[label] = parameters


def test_a_change_that_a_take_off_overtakes_is_refused_when_it_is_due():
    holder, told = Grounded(), []
    options = Options({holder.name: holder}, Events((told.append,)))
    options.set("a.supervisors.fence.margin", "1 m", "test")
    holder.airborne = True
    options.apply()
    assert options.get("a.supervisors.fence.margin") == 0.1
    assert [e.name for e in told] == ["option_refused"]
