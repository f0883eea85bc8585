"""A matrix as an option: read, set as text and as numbers, refused with a reason, tightened."""

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
from kybflow.parts.catalog import load_catalog
from kybflow.runtime.events import Events
from kybflow.runtime.options import Options

GAIN, LIMIT = "mk.tracker.position_gain", "mk.supervisors.coupled.limit"
TEXT = "[[1, 0, 0], [0, 1, 0], [0, 0, 1]]"
ONE = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@params
class CoupledParams:
    limit: Matrix[Literal[2], Literal[2], Damping] = param(
        "How fast each may answer the other.", default=((2.0, 1.0), (1.0, 2.0)), tightens="down"
    )


class Holder:
    name = "mk"
    airborne = False

    def __init__(self) -> None:
        cascade = load_catalog().get("trackers", "cascade").params()
        self.params: dict[str, Any] = {"tracker": cascade, "supervisors.coupled": CoupledParams()}

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


@pytest.mark.parametrize(
    "value", [TEXT, " [ [1,0,0],[0 , 1, 0], [0,0, 1.0] ] ", ONE, [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
              np.eye(3)],
)  # fmt: skip
def test_it_is_set_as_text_or_as_rows_of_numbers(options, told, value) -> None:
    assert options.get(GAIN) is None
    options.set(GAIN, value, by="test")
    options.apply()
    assert options.get(GAIN) == ONE
    assert told[-1].name == "option_changed"


def test_its_numbers_have_units(options) -> None:
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
def test_a_wrong_one_is_refused_with_the_reason(options, told, name, value, reason) -> None:
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


def test_it_is_set_when_a_run_begins(run) -> None:
    plan = vehicle("mk", [up("hold"), hold(1.0, "down"), down()])
    name = "mk.trackers.cascade.position_gain"
    _, told = run(plan, options=((name, TEXT.replace("1", "8")),))
    [changed] = named(told, "option_changed")
    assert changed.fields["option"] == name
    assert named(told, "option_refused") == []
