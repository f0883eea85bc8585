"""Arithmetic with parameters."""

from __future__ import annotations

import pytest

from kybflow.core.units import ANGLE, DURATION, LENGTH, NUMBER, RATIO, SPEED
from kybflow.dsl.resolving.arithmetic import MAX_LENGTH, Mistake, amount_of, result_of

AMOUNTS = {
    name: amount_of(text, dimension)
    for name, text, dimension in (
        ("height", "1 m", LENGTH), ("side", "50 cm", LENGTH), ("speed", "0.3 m/s", SPEED),
        ("lap", "3 s", DURATION), ("laps", "3", NUMBER), ("share", "20 %", RATIO),
        ("turn", "90 deg", ANGLE), ("none", "0", NUMBER), ("wide", "1e99", NUMBER),
    )
}  # fmt: skip


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("$height + 20 cm", "1.2 m"),
        ("$height+0.2", "1.2 m"),  # a number without a unit is in SI
        ("0.1 + $side * 0.4", "0.3 m"),  # not 0.30000000000000004
        ("$side + 20 cm", "70 cm"),  # in the unit that both have
        ("$speed * 2", "0.6 m/s"),
        ("2 * $speed / 3", "0.2 m/s"),
        ("-$side", "-50 cm"),
        ("--$side", "50 cm"),
        ("($height + $side) / 2", "0.75 m"),
        ("$height - $side - $side", "0 m"),
        ("$height - ($side - $side)", "1 m"),
        ("$height / 3", f"{1 / 3!r} m"),
        ("$height / $side", "2"),
        ("$speed * $lap", "0.9 m"),
        ("$height / $lap * 3", "1 m/s"),
        ("$height / $speed * 0.3", "1 s"),
        ("$laps + 1", "4"),
        ("($laps + 1) * $share", "0.8"),
        ("$share * 2", "40 %"),
        ("$share + 5 %", "25 %"),
        ("$height * $share", "0.2 m"),
        ("$turn / 2 + 0.5 deg", "45.5 deg"),
    ],
)
def test_results(text: str, expected: str) -> None:
    assert expected == result_of(text, AMOUNTS)


@pytest.mark.parametrize(
    ("text", "message", "marked"),
    [
        ("$height + $lap", "a length and a duration can't be added", "$height + $lap"),
        ("1 m + ($lap - $turn)", "a duration and an angle can't be subtracted", "$lap - $turn"),
        ("2 * $lap / $turn", "a duration can't be divided by an angle", "2 * $lap / $turn"),
        ("$turn + 2", "an angle and a number can't be added", "$turn + 2"),
        ("$height / ($none * 2)", "this divides by zero", "$height / ($none * 2)"),
        ("$height + 2 parsec", "`parsec` is not a unit", "parsec"),
        ("$height $lap", "found `$` where `+`, `-`, `*`, `/` or the end should be", "$"),
        ("$wide * $wide * $wide * $wide", "the result is too large", None),
        ("(" * (MAX_LENGTH - 5) + "$side", "found the end where `)` should be", ""),
    ],
)
def test_mistakes(text: str, message: str, marked: str | None) -> None:
    with pytest.raises(Mistake) as caught:
        result_of(text, AMOUNTS)
    assert message == str(caught.value)
    assert marked is None or marked == text[caught.value.start : caught.value.end]
