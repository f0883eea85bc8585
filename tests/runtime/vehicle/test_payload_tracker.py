"""What is known of a payload, and what a servo is asked for."""

from __future__ import annotations

from part_bench import estimate

from kybflow.core.signals import NS, Event, Payload, PayloadState
from kybflow.runtime.events import Events
from kybflow.runtime.vehicle.knowledge import PayloadTracker

CLOSED, OPEN = Payload(0, False, True), Payload(0, True, False)
BLIND_CLOSED, BLIND_OPEN = Payload(0, False, None), Payload(0, True, None)


def cargo(*said: Payload) -> tuple[PayloadTracker, list[Event]]:
    told: list[Event] = []
    made = PayloadTracker("a", Events([told.append]))
    for word in said:
        made.update(word, None, 0)
    return made, told


def test_nothing_is_known_before_the_vehicle_says_something() -> None:
    made, told = cargo()
    assert (made.state, made.releases, told) == (None, 0, [])


def test_what_was_on_board_and_is_let_go_is_released_and_told_with_its_place() -> None:
    made, told = cargo(CLOSED)
    assert made.state is PayloadState.ABOARD
    assert made.wants(True, 2 * NS, "m.yaml:7")
    assert made.wants(True, 2 * NS + 1, "m.yaml:7")
    made.update(OPEN, estimate((1.0, 2.0, 3.0)), 2 * NS + NS // 2)
    assert (made.state, made.releases) == (PayloadState.RELEASED, 1)
    [event] = told
    assert (event.name, event.vehicle) == ("payload_released", "a")
    assert event.fields == {"x": 1.0, "y": 2.0, "z": 3.0, "took": 0.5}


def test_it_is_not_released_again_and_who_asks_is_told() -> None:
    made, told = cargo(CLOSED, OPEN)
    assert not made.wants(True, NS, "m.yaml:9")
    made.update(OPEN, None, NS)
    assert made.releases == 1
    assert [(e.name, e.at) for e in told[1:]] == [("payload_already_released", "m.yaml:9")]


def test_a_release_that_was_acknowledged_too_late_counts_too() -> None:
    made, _ = cargo(BLIND_CLOSED)
    made.wants(True, NS, "")
    made.update(BLIND_OPEN, None, 9 * NS)
    assert (made.state, made.releases) == (PayloadState.RELEASED, 1)


def test_loaded_anew_it_may_be_released_anew() -> None:
    made, told = cargo(CLOSED, OPEN)
    assert made.wants(False, NS, "")
    made.update(CLOSED, None, NS)
    assert made.state is PayloadState.ABOARD
    assert made.wants(True, 2 * NS, "")
    made.update(OPEN, None, 2 * NS)
    assert made.releases == 2
    assert [e.name for e in told] == ["payload_released", "payload_loaded", "payload_released"]


def test_a_vehicle_that_can_not_tell_what_it_carries_is_not_believed_to_carry_something() -> None:
    made, _ = cargo(BLIND_CLOSED)
    assert made.state is None
    assert cargo(BLIND_OPEN)[0].state is PayloadState.ABSENT
    assert cargo(OPEN)[0].state is PayloadState.ABSENT
    assert cargo(Payload(0, False, False))[0].state is PayloadState.ABSENT


def test_an_open_servo_with_the_payload_still_there_has_released_nothing() -> None:
    made, told = cargo(CLOSED)
    made.wants(True, NS, "")
    made.update(Payload(NS, True, True), None, NS)
    assert (made.state, made.releases, told) == (PayloadState.ABOARD, 0, [])


def test_a_servo_is_not_asked_for_what_it_does_already() -> None:
    made, _ = cargo(BLIND_CLOSED)
    assert not made.wants(False, NS, "")
    assert made.wants(True, NS, "")
