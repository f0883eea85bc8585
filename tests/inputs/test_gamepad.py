"""A gamepad by way of SDL's virtual joystick: its sticks, buttons, maps, and being plugged out."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest
import waiting

pytest.importorskip("pygame")

from virtual_pad import VirtualPad

from kybflow.core.errors import FileError
from kybflow.core.files import File
from kybflow.core.signals import InputReading
from kybflow.inputs import sdl
from kybflow.inputs.gamepad import Gamepad, GamepadParams, PadLink, read_controllers

RIGHT_X, RIGHT_Y = 2, 3
A, X = 0, 2


@pytest.fixture
def opened() -> Iterator[Callable[..., PadLink]]:
    links: list[PadLink] = []

    def open_(**own: object) -> PadLink:
        link = Gamepad.open(GamepadParams(**own), lambda _: None)  # type: ignore[arg-type]
        assert isinstance(link, PadLink)
        links.append(link)
        return link

    yield open_
    for link in links:
        link.close()


@pytest.fixture
def pad(opened: Callable[..., PadLink]) -> Iterator[VirtualPad]:
    opened()  # SDL has begun
    plugged = VirtualPad()
    yield plugged
    plugged.unplug()


def until(link: PadLink, what: Callable[[InputReading], bool]) -> InputReading:
    """Read until the device says that."""
    said: list[InputReading] = []

    def heard() -> bool:
        reading = link.read(0)
        said[:] = [] if reading is None else [reading]
        return reading is not None and link.trouble() is None and what(reading)

    waiting.until(heard, "the device")
    return said[0]


def test_an_axis_that_the_device_lacks_is_trouble(monkeypatch: pytest.MonkeyPatch) -> None:
    listening = []
    monkeypatch.setattr(sdl, "listen", listening.append)
    link = PadLink(GamepadParams())
    [receive] = listening
    axes = dict.fromkeys(("left_x", "left_y", "right_x"), 0.0)
    receive((sdl.PadState("Half a pad", axes, frozenset()),))
    link.read(0)
    assert (
        link.trouble() == "`Half a pad` has no axis `right_y`: give `x` another source, or `none`"
    )
    receive((sdl.PadState("A pad", {**axes, "right_y": 0.0}, frozenset()),))
    link.read(0)
    assert link.trouble() is None


def test_the_sticks_are_those_of_mode_two(opened: Callable[..., PadLink], pad: VirtualPad) -> None:
    link = opened(dead_zone=0.0, expo=0.0)
    pad.move(RIGHT_Y, -1.0)
    pad.move(RIGHT_X, 0.5)
    said = until(link, lambda r: r.axes["x"] > 0.9)
    assert pytest.approx({"x": 1.0, "y": -0.5, "z": 0.0, "turn": 0.0}, abs=1e-3) == said.axes


def test_it_is_soft_around_the_centre(opened: Callable[..., PadLink], pad: VirtualPad) -> None:
    link = opened(dead_zone=0.1, expo=0.5)
    pad.move(RIGHT_Y, -0.09)
    assert until(link, lambda r: True).axes["x"] == 0.0
    pad.move(RIGHT_Y, -0.55)
    said = until(link, lambda r: r.axes["x"] > 0.1)
    assert pytest.approx(0.5 * 0.5 + 0.5 * 0.5**3, abs=1e-3) == said.axes["x"]


def test_a_press_between_two_reads_is_not_missed(
    opened: Callable[..., PadLink], pad: VirtualPad
) -> None:
    link = opened()
    until(link, lambda r: not r.held)
    pad.press(A)
    other = opened()
    until(other, lambda r: "a" in r.held)
    pad.press(A, down=False)
    until(other, lambda r: "a" not in r.held)
    assert {"a"} == until(link, lambda r: True).held
    assert not until(link, lambda r: "a" not in r.held).held


def test_it_is_plugged_out_and_in(opened: Callable[..., PadLink]) -> None:
    link = opened()
    waiting.until(lambda: link.read(0) is None and link.trouble() is not None, "trouble")
    assert link.trouble() == "no controller is plugged in"
    pad = VirtualPad()
    until(link, lambda r: True)
    pad.unplug()
    waiting.until(lambda: link.read(0) is not None and link.trouble() is not None, "trouble")
    assert "is unplugged" in (link.trouble() or "")
    again = VirtualPad()
    until(link, lambda r: True)
    again.unplug()


def test_only_the_controller_that_is_named_is_heard(
    opened: Callable[..., PadLink], pad: VirtualPad
) -> None:
    link = opened(controller="Taranis")
    waiting.until(lambda: link.read(0) is None and link.trouble() is not None, "trouble")
    assert link.trouble() == "no controller like `Taranis` is plugged in"
    until(opened(controller="virtual"), lambda r: True)


def test_a_joystick_that_sdl_does_not_know_has_numbers(opened: Callable[..., PadLink]) -> None:
    link = opened(x="axis4", y="axis0", z="axis1", turn="none", dead_zone=0.0, expo=0.0)
    stick = VirtualPad(kind=2)
    stick.move(4, 0.5)
    stick.press(7)
    said = until(link, lambda r: r.axes["x"] > 0.4)
    assert {"button7"} == said.held
    stick.unplug()


TABLE = "controller, axis, source, low, centre, high\nVirtual, x, -right_x, -0.8, 0.1, 0.9\n"


def test_a_table_maps_and_calibrates_by_the_controllers_name(
    opened: Callable[..., PadLink], pad: VirtualPad
) -> None:
    link = opened(controllers=File("pads.csv", "1", TABLE), dead_zone=0.0, expo=0.0)
    pad.move(RIGHT_X, -0.35)
    said = until(link, lambda r: r.axes["x"] > 0.3)
    assert pytest.approx(0.5, abs=1e-3) == said.axes["x"]


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("V, w, axis1, -1, 0, 1", "no axis `w`"),
        ("V, x, axes1, -1, 0, 1", "not a source of an axis"),
        ("V, x, axis1, -1, 1, 0", "must rise"),
    ],
)
def test_a_table_that_is_none_is_refused(row: str, message: str) -> None:
    text = TABLE.splitlines()[0] + f"\n{row}\n"
    with pytest.raises(FileError, match=message):
        read_controllers(File("pads.csv", row, text))


def test_a_controller_that_is_gone_before_it_is_opened_ends_nothing(
    opened: Callable[..., PadLink],
) -> None:
    import pygame

    link = opened()
    pygame.event.post(pygame.event.Event(pygame.JOYDEVICEADDED, device_index=77))
    plugged = VirtualPad()
    until(link, lambda r: True)
    plugged.unplug()
