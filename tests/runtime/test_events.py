"""Events are told at once and heard one tick later, by the short name by their own vehicle only."""

from kybflow.core.signals import Event
from kybflow.runtime.events import Events


def test_listeners_hear_at_once():
    told: list[Event] = []
    events = Events((told.append,))
    events.turn(8)
    events.tell("took_off", "mk", "m.yaml:3", height=1.0)
    assert told == [Event(8, "took_off", "mk", {"height": 1.0}, "m.yaml:3")]


def test_transitions_hear_in_the_next_tick_only():
    events = Events()
    events.tell("took_off", "mk")
    assert events.heard("mk") == set()
    events.turn(1)
    assert events.heard("mk") == {"took_off", "mk.took_off", "any.took_off"}
    assert events.heard("nano") == {"mk.took_off", "any.took_off"}
    events.turn(2)
    assert events.heard("mk") == set()
