"""From a terminal's bytes to keys."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kybflow.cli.keys import ENTER, ESCAPE, PressedKeys

UP, DELETE, F1, ALT_L = b"\x1b[A", b"\x1b[3~", b"\x1bOP", b"\x1bl"
PASTED = b"\x1b[200~land\r\x1b[201~"


@pytest.mark.parametrize(
    ("data", "keys"),
    [
        (b"l", ["l"]),
        (b"1\r", ["1", ENTER]),
        (b"\n", [ENTER]),
        ("ö".encode(), ["ö"]),
        (UP + DELETE + F1 + b"p", ["p"]),
        (ALT_L, []),
        (b"\x13\x7f\t", []),
        (b"\xff", []),
        (PASTED + b"p", ["p"]),
        (b"\x1b\x1b[A", [ESCAPE]),
        (b"\x1b", []),
    ],
)
def test_what_is_a_key(data: bytes, keys: list[str]) -> None:
    assert PressedKeys().read(data) == keys


def test_an_escape_is_a_key_when_nothing_follows() -> None:
    pressed = PressedKeys()
    assert pressed.read(b"p\x1b") == ["p"]
    assert pressed.read(b"") == [ESCAPE]
    assert pressed.read(b"") == []


def test_half_a_sequence_that_stays_half_is_forgotten() -> None:
    pressed = PressedKeys()
    assert pressed.read(b"\x1b[") == []
    assert pressed.read(b"") == []
    assert pressed.read(b"A") == ["A"]


@given(st.lists(st.sampled_from([b"l", b"\r", UP, DELETE, F1, PASTED, b"\x1b[200~x"])), st.data())
def test_it_is_the_same_however_the_bytes_arrive(pieces: list[bytes], data: st.DataObject) -> None:
    whole = b"".join(pieces)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(whole)), max_size=6)))
    pressed = PressedKeys()
    parts = [whole[a:b] for a, b in zip([0, *cuts], [*cuts, len(whole)], strict=True)]
    found = [key for part in parts if part for key in pressed.read(part)]
    assert found == PressedKeys().read(whole)
