"""Keys as an input: what is pressed pushes, what is let go stops, other letters are buttons."""

from __future__ import annotations

from typing import Any

import pytest

from kybflow.core.errors import DriverError
from kybflow.core.signals import NS, InputReading
from kybflow.inputs.keyboard import Keyboard, KeyboardParams, KeyLink

UP, DOWN, RIGHT, LEFT = (f"\x1b[{letter}" for letter in "ABCD")


class Typing:
    """Stands for a terminal."""

    def __init__(self) -> None:
        self.typed, self.is_open = "", False

    def __enter__(self) -> Typing:
        self.is_open = True
        return self

    def __exit__(self, *_: object) -> None:
        self.is_open = False

    def read(self) -> bytes:
        typed, self.typed = self.typed, ""
        return typed.encode()


class Person:
    def __init__(self) -> None:
        self.terminal: Any = Typing()
        self.link = KeyLink(KeyboardParams(deflection=0.5), self.terminal)
        self.time = 0.0

    def types(self, keys: str, after: float = 0.0) -> InputReading:
        self.time += after
        self.terminal.typed = keys
        reading = self.link.read(round(self.time * NS))
        assert reading is not None
        return reading


@pytest.mark.parametrize(
    ("key", "axis", "value"),
    [
        (UP, "x", 0.5), (DOWN, "x", -0.5), (LEFT, "y", 0.5), (RIGHT, "y", -0.5),
        ("w", "z", 0.5), ("S", "z", -0.5), ("a", "turn", 0.5), ("d", "turn", -0.5),
        ("\x1bOA", "x", 0.5),
    ],
)  # fmt: skip
def test_a_key_pushes_its_axis(key: str, axis: str, value: float) -> None:
    said = Person().types(key)
    assert {axis: value} == {name: v for name, v in said.axes.items() if v}
    assert not said.held


def test_a_touch_is_short_and_what_is_held_goes_on_until_it_is_let_go() -> None:
    person = Person()
    person.types(UP)
    assert person.types("", after=0.5).axes["x"] == 0.5
    assert person.types("", after=0.2).axes["x"] == 0.0
    person.types(UP)
    person.types(UP, after=0.5)
    for _ in range(20):
        assert person.types(UP, after=0.03).axes["x"] == 0.5
    assert person.types("", after=0.1).axes["x"] == 0.5
    assert person.types("", after=0.1).axes["x"] == 0.0


def test_the_space_bar_stops_and_two_keys_push_together() -> None:
    person = Person()
    said = person.types(UP + "a")
    assert (said.axes["x"], said.axes["turn"]) == (0.5, 0.5)
    assert {0.0} == set(person.types(" ").axes.values())


def test_other_letters_are_buttons_for_one_look() -> None:
    person = Person()
    assert {"g", "enter"} == person.types("G\r").held
    assert not person.types("").held


def test_the_terminal_is_given_back() -> None:
    person = Person()
    assert person.terminal.is_open
    person.link.close()
    assert not person.terminal.is_open


def test_without_a_terminal_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin.isatty", lambda: False, raising=False)
    with pytest.raises(DriverError, match="no terminal"):
        Keyboard.open(KeyboardParams(), lambda _: None)
