"""What a drone performs on request, and what it is told for that."""

from __future__ import annotations

import pytest

from kybflow.drivers.ardrone import Ardrone
from kybflow.drivers.ardrone.acts import ACTS, CALIBRATE, FLIGHTS, LEDS, lasts, lines_of
from kybflow.drivers.ardrone.at import Ids, datagrams
from kybflow.drivers.ardrone.params import ArdroneParams

IDS = Ids("11111111", "22222222", "33333333")


@pytest.mark.parametrize(
    ("act", "sent"),
    [
        (
            "leds_blink_red",
            b'AT*CONFIG_IDS=1,"11111111","22222222","33333333"\r'
            b'AT*CONFIG=2,"leds:leds_anim","2,1073741824,3"\r',
        ),
        ("flip_left", b'AT*CONFIG=1,"control:flight_anim","18,15"\r'),
        ("turn_around", b'AT*CONFIG=1,"control:flight_anim","6,5000"\r'),
        (CALIBRATE, b"AT*CALIB=1,0\r"),
    ],
)
def test_what_is_sent(act, sent):
    assert datagrams([lines_of(act, IDS)], 1)[0] == [sent]


def test_all_of_the_sdk_s_are_there():
    assert (len(LEDS), len(FLIGHTS)) == (21, 20)
    assert all(lines_of(act, IDS) for act in ACTS)
    assert all(lasts(act) > 0 for act, kind in ACTS.items() if kind.moves)


def test_only_leds_are_played_without_permission():
    assert [name for name, act in ACTS.items() if not act.moves] == [f"leds_{n}" for n in LEDS]
    assert {act.needs for act in Ardrone.acts.values() if act.moves} == {"maneuvers"}
    assert ArdroneParams().maneuvers is False
