"""release_payload and load_payload: they ask until the vehicle has acknowledged it."""

from __future__ import annotations

import pytest
from part_bench import at_rest, entry, estimate, tick

from kybflow.core.geometry import ZERO
from kybflow.core.signals import Done, Failed, Grip, PayloadState
from kybflow.flight.motion import IDLE
from kybflow.parts import GROUND
from kybflow.runtime.behaviors.load_payload import LoadPayload, LoadPayloadParams
from kybflow.runtime.behaviors.release_payload import ReleasePayload, ReleasePayloadParams

PLACE = (0.5, 0.0, 1.0)
HELD = at_rest(PLACE)
ABOARD, RELEASED, ABSENT = PayloadState.ABOARD, PayloadState.RELEASED, PayloadState.ABSENT


def behavior(velocity=ZERO, **params):
    return ReleasePayload(ReleasePayloadParams(**params), entry(PLACE, velocity))


def at(time, payload=ABOARD):
    return tick(time, estimate(PLACE))._replace(payload=payload)


def test_it_asks_until_it_is_acknowledged_then_holds_until_the_vehicle_has_settled() -> None:
    drop = behavior(settle=0.5)
    assert drop.update(at(0.0)) == drop.update(at(1.0)) == Grip(HELD, True)
    assert drop.update(at(1.1, RELEASED)) == HELD
    assert drop.update(at(1.59, RELEASED)) == HELD
    assert drop.update(at(1.61, RELEASED)) == Done(HELD)


def test_a_vehicle_that_can_not_say_what_it_carries_is_asked_as_well() -> None:
    assert behavior().update(at(0.0, None)) == Grip(HELD, True)


def test_it_comes_to_rest_first_and_its_patience_begins_then() -> None:
    drop = behavior((0.6, 0.0, 0.0), patience=1.0)
    asked = next(n for n in range(1000) if isinstance(drop.update(at(n / 100)), Grip)) / 100
    assert 0.5 < asked < 1.0
    last = drop.update(at(asked + 0.99))
    assert isinstance(last, Grip)
    assert last.setpoint.velocity == ZERO
    assert isinstance(drop.update(at(asked + 1.01)), Failed)


def test_without_an_acknowledgement_it_fails_with_the_reason() -> None:
    drop = behavior(patience=2.0)
    assert isinstance(drop.update(at(0.0)), Grip)
    failed = drop.update(at(2.01))
    assert failed == Failed(HELD, "the release was not acknowledged within 2 s")


def test_entered_again_it_is_done_at_once() -> None:
    drop = behavior()
    assert drop.update(at(0.0, RELEASED)) == Grip(HELD, True)  # the vehicle tells, and does nothing
    assert drop.update(at(0.004, RELEASED)) == Done(HELD)


def test_it_fails_where_nothing_is_on_board() -> None:
    assert behavior().update(at(0.0, ABSENT)) == Failed(HELD, "no payload is on board")


def test_on_the_ground_the_rotors_rest_and_nothing_has_to_settle() -> None:
    drop = ReleasePayload(ReleasePayloadParams(), entry(ZERO, flight=GROUND))
    assert drop.update(at(0.0)) == Grip(IDLE, True)
    assert drop.update(at(0.1, RELEASED)) == Done(IDLE)


@pytest.mark.parametrize("before", [None, ABSENT, RELEASED])
def test_loading_closes_the_servo_until_the_vehicle_says_that_it_is_on_board(before) -> None:
    load = LoadPayload(LoadPayloadParams(), entry(ZERO, flight=GROUND))
    assert load.update(at(0.0, before)) == load.update(at(99.0, before)) == Grip(IDLE, False)
    assert load.update(at(99.1, ABOARD)) == Done(IDLE)
