"""Events are recorded at once and heard one tick later, by short names by their own vehicle."""

import pytest

from kybflow.core.events import Custom, VehicleEvent
from kybflow.core.signals import Event
from kybflow.core.units import Length
from kybflow.parts.events import Collided, TookOff
from kybflow.runtime.events import Events


class BirdMet(VehicleEvent):
    """A bird came close."""

    height: Length
    species: str
    weight: float | None = None


def test_listeners_hear_at_once():
    told: list[Event] = []
    events = Events((told.append,))
    events.turn(8)
    events.emit(BirdMet(species="gull", height=1.0), "mk", "m.yaml:3")
    assert told == [Event(8, "bird_met", "mk", {"height": 1.0, "species": "gull"}, "m.yaml:3")]


def test_transitions_hear_in_the_next_tick_only():
    events = Events()
    events.emit(TookOff(), "mk")
    assert events.heard("mk") == set()
    events.turn(1)
    assert events.heard("mk") == {"took_off", "mk.took_off", "any.took_off"}
    assert events.heard("nano") == {"mk.took_off", "any.took_off"}
    events.turn(2)
    assert events.heard("mk") == set()


def test_what_is_recorded_only_is_heard_by_listeners_alone():
    told: list[Event] = []
    events = Events((told.append,))
    events.emit(Collided(into="wall"), "mk")
    events.turn(1)
    assert [event.name for event in told] == ["collided"]
    assert events.unanswered == []
    assert events.heard("mk") == set()


def test_a_field_that_has_its_default_is_left_out_and_one_without_a_default_never():
    class Weighed(VehicleEvent):
        """Weighed."""

        scale: str | None
        weight: float | None = None

    assert Weighed(scale=None).recorded() == {"scale": None}
    assert Weighed(weight=0.0, scale=None).recorded() == {"scale": None, "weight": 0.0}


@pytest.mark.parametrize("fields", [{}, {"height": 1.0}, {"height": 1.0, "species": "", "x": 0}])
def test_an_event_takes_its_fields_and_no_others(fields: dict[str, object]):
    with pytest.raises(TypeError, match="`bird_met` has the fields"):
        BirdMet(**fields)


def test_events_are_equal_when_their_fields_are():
    gull = BirdMet(height=1.0, species="gull")
    assert gull == BirdMet(species="gull", height=1.0)
    assert gull != gull.replaced(species="crow") == BirdMet(height=1.0, species="crow")
    assert Custom("go") != Custom("stop")
    assert repr(gull) == "BirdMet(height=1.0, species='gull', weight=None)"


def test_no_field_hides_what_every_event_has():
    with pytest.raises(TypeError, match="a field of Named can't be called `name`"):

        class Named(VehicleEvent):
            """Somebody was named."""

            name: str
