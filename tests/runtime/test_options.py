"""Options: applied at the next tick, bounded, typed; a refusal says why and changes nothing."""

from dataclasses import replace
from typing import Any

import pytest

from kybflow.core.errors import OptionRefused
from kybflow.core.signals import Event
from kybflow.parts.catalog import load_catalog
from kybflow.runtime.events import Events
from kybflow.runtime.options import Options

NAME = "mk.processors.limit_speed.speed"


class Holder:
    name = "mk"
    airborne = False

    def __init__(self) -> None:
        spec = load_catalog().get("processors", "limit_speed")
        sim = load_catalog().get("drivers", "sim")
        self.params: dict[str, Any] = {
            "processors.limit_speed": spec.params(),
            "driver": sim.params(),
            "processors.avoid_obstacles": load_catalog()
            .get("processors", "avoid_obstacles")
            .params(),
        }

    def parameters(self) -> dict[str, Any]:
        return self.params

    def change(self, label: str, name: str, value: Any) -> None:
        self.params[label] = replace(self.params[label], **{name: value})


@pytest.fixture
def told() -> list[Event]:
    return []


@pytest.fixture
def options(told: list[Event]) -> Options:
    return Options({Holder.name: Holder()}, Events((told.append,)))


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
        ("mk.driver.physics", "400 Hz", "is read-only"),
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
    name = "mk.processors.avoid_obstacles.treat_as_obstacles"
    options.set(name, value, by="test")
    options.apply()
    assert options.get(name) == names


def test_a_vehicle_that_is_not_there_is_refused(options, told):
    name = "mk.processors.avoid_obstacles.treat_as_obstacles"
    with pytest.raises(OptionRefused, match="there is no vehicle `nobody`"):
        options.set(name, "[mk, nobody]", by="test")
    assert told[-1].name == "option_refused"


@pytest.mark.parametrize("value", ["[", "", ",", "[mk", "[[mk]]", "{mk: mk}"])
def test_half_a_list_of_names_is_no_empty_one(options, told, value):
    name = "mk.processors.avoid_obstacles.treat_as_obstacles"
    with pytest.raises(OptionRefused, match=r"must be a list of names|never closed|nothing stands"):
        options.set(name, value, by="test")
    assert told[-1].name == "option_refused"
