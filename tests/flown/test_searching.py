"""While a run flies, what was there before is not searched for garbage; afterwards it is again."""

from __future__ import annotations

import gc
import itertools

import pytest
from plans import Through, vehicle, wrapped
from short_flights import down, up

from kybflow.api.flight import COLLECTED_IN_FLIGHT
from kybflow.core.errors import DriverError
from kybflow.core.signals import NS

SPARSELY = 50
"""Of how many looks one is taken: the interpreter counts what is frozen one by one."""


class Loose(Through):
    """A link whose cable comes out after a second."""

    def read(self, now):
        if now >= NS:
            raise DriverError("the cable is out")
        return super().read(now)


@pytest.fixture
def frozen():
    """What was frozen before, which a run must leave so: nothing."""
    assert gc.get_freeze_count() == 0
    yield []
    gc.unfreeze()


@pytest.mark.parametrize(
    ("driver", "code"),
    [
        ({}, 0),
        pytest.param(
            {"driver": wrapped(lambda _, link: Loose(link))}, 3, marks=pytest.mark.thorough
        ),
    ],
)
def test_no_tick_searches_what_was_there_before(run, frozen, driver, code):
    looks = itertools.count()

    def look(_) -> None:
        if next(looks) % SPARSELY == 0:
            frozen.append(gc.get_freeze_count())

    flown, _ = run(vehicle("a", [up("down"), down()], **driver), observers=(look,))
    assert flown.exit_code == code
    assert min(frozen) > 0
    assert gc.get_freeze_count() == 0


def test_an_engine_that_breaks_leaves_nothing_unsearched(run, frozen, monkeypatch):
    def breaks(engine):
        frozen.append(gc.get_freeze_count())
        raise ZeroDivisionError("a bug of ours")

    monkeypatch.setattr("kybflow.runtime.engine.Engine.run", breaks)
    with pytest.raises(ZeroDivisionError):
        run(vehicle("a", [up("down"), down()]))
    assert min(frozen) > 0
    assert gc.get_freeze_count() == 0


def test_a_tick_searches_few_new_objects_where_the_program_lets_many_gather(run, frozen):
    before, found = gc.get_threshold(), []
    gc.set_threshold(200_000)
    try:
        observers = (lambda _: found.append(gc.get_threshold()),)
        run(vehicle("a", [up("down"), down()]), observers=observers)
        assert gc.get_threshold()[0] == 200_000
    finally:
        gc.set_threshold(*before)
    assert set(found) == {COLLECTED_IN_FLIGHT}
