"""Quantities: what is read, what is refused and with which way out."""

from contextlib import suppress
from math import isfinite, pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kybflow.core.errors import UnitError
from kybflow.core.units import (
    ANGLE,
    DAMPING,
    DIMENSIONS,
    DURATION,
    INERTIA,
    LENGTH,
    RATIO,
    SPEED,
    format_quantity,
    parse_quantity,
)


@pytest.mark.parametrize(
    ("value", "text", "dimension"),
    [
        (1.2, "1.2 m", LENGTH),
        (0.5, "50cm", LENGTH),
        (-0.03, "-3e-2 m", LENGTH),
        (2.0, "2", LENGTH),
        (0.3, "300 ms", DURATION),
        (0.2, "20 %", RATIO),
        (0.25, "0.25 1/s", DAMPING),
        (pi, "180 deg", ANGLE),
        (10.0, "36 km/h", SPEED),
        (0.012, "0.012 kg m^2", INERTIA),
    ],
)
def test_quantities_are_read_in_si(value, text, dimension):
    assert parse_quantity(text, dimension) == pytest.approx(value)


@pytest.mark.parametrize(
    ("text", "dimension", "message", "hint"),
    [
        ("20", ANGLE, "an angle needs a unit", "write `20 deg` or `20 rad`"),
        ("2 s", LENGTH, "`2 s` is a duration, but a length is needed", "write it like `1.2 m`"),
        ("2 metres", LENGTH, "`metres` is not a unit of length", "`m`, `cm`, `mm`, `km`"),
        ("fast", SPEED, "`fast` is not a speed", "write it like `0.5 m/s`"),
        ("nan", LENGTH, "`nan` is not a length", "1.2 m"),
        ("inf m", LENGTH, "`inf m` is not a length", "1.2 m"),
        ("1e999 m", LENGTH, "`1e999 m` is not finite", "1.2 m"),
        ("1.2.3 m", LENGTH, "`1.2.3 m` is not a length", "1.2 m"),
        ("1,5 m", LENGTH, "`1,5 m` is not a length", "write `1.5 m`"),
        ("1 ,5 m", LENGTH, "`1 ,5 m` is not a length", "write `1.5 m`"),
        ("- 1 m", LENGTH, "`- 1 m` is not a length", "write `-1 m`"),
        ("\u22121 m", LENGTH, "is not a length", "write `-1 m`"),
        ("1\u00a0m", LENGTH, "has characters of another script", "write `1 m`"),
        ("\uff11 m", LENGTH, "is not a length", "write `1 m`"),
    ],
)
def test_refusals_say_what_was_found_and_the_way_out(text, dimension, message, hint):
    with pytest.raises(UnitError) as refused:
        parse_quantity(text, dimension)
    assert message in str(refused.value)
    assert hint in refused.value.hint


@given(st.sampled_from(sorted(DIMENSIONS)), st.floats(-1e6, 1e6))
def test_what_is_written_is_read_back(name, value):
    dimension = DIMENSIONS[name]
    back = parse_quantity(format_quantity(value, dimension), dimension)
    assert back == pytest.approx(value, rel=1e-3, abs=1e-12)


@given(st.text(max_size=20), st.sampled_from(sorted(DIMENSIONS)))
def test_any_text_is_a_finite_number_or_a_refusal(text, name):
    with suppress(UnitError):
        assert isfinite(parse_quantity(text, DIMENSIONS[name]))
