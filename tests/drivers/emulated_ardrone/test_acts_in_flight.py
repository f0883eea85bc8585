"""A drone plays its LEDs and is calibrated in flight, asked by the mission or by a person, and is
told why not."""

from __future__ import annotations

from ardrone_flights import flown, mission

from kybflow.api.flight import RunRequest
from kybflow.core.signals import NS
from kybflow.runtime.commanding.command_queue import RecordedCommand

ON = """on:
  - {event: a.took_off, do: [{perform: {a: leds_blink_green}}]}
"""


def asked(seconds, words):
    return RecordedCommand(round(seconds * NS), words, "alice", False)


def flight(folder, *commands, **params):
    request = RunRequest(out=folder / "run", again=commands)
    return flown(mission(["a"], 6.0) + ON, folder, request=request, wifi_loss=0.0, **params)


def answers(told):
    names = ("performed", "perform_refused")
    return [(e.fields["act"], e.fields.get("reason")) for e in told if e.name in names]


def test_leds_play_for_the_mission_and_for_a_person_and_nothing_else_does(tmp_path):
    commands = (asked(9.0, "perform a leds_fire"), asked(9.5, "perform a flip_left"),
                asked(9.6, "perform a somersault"))  # fmt: skip
    done, told, session = flight(tmp_path, *commands)
    assert done.summary["outcome"] == "succeeded", told
    assert answers(told) == [
        ("leds_blink_green", None),
        ("leds_fire", None),
        ("flip_left", "its driver performs it with `maneuvers: true` only"),
        ("somersault", "its driver performs no `somersault`"),
    ]
    values = session.links["a"].drone.configuration.values
    assert values["leds:leds_anim"] == "5,1073741824,3"
    assert values["control:flight_anim"] == "0,0"


def test_with_permission_it_is_asked_for_a_flip_and_a_calibration_in_flight_alone(tmp_path):
    commands = (asked(2.5, "perform a flip_left"), asked(9.0, "perform a flip_left"),
                asked(9.5, "perform a calibrate_magnetometer"))  # fmt: skip
    done, told, session = flight(tmp_path, *commands, maneuvers=True)
    assert done.summary["outcome"] == "succeeded", told
    assert answers(told) == [
        ("flip_left", "it doesn't fly"),
        ("leds_blink_green", None),
        ("flip_left", None),
        ("calibrate_magnetometer", None),
    ]
    drone = session.links["a"].drone
    assert drone.configuration.values["control:flight_anim"] == "18,15"
    assert drone.accepted == {"CALIB": 1}


def test_who_lands_it_has_it_but_its_leds(tmp_path):
    commands = (asked(9.0, "land a"), asked(9.5, "perform a flip_left"),
                asked(9.6, "perform a leds_red"))  # fmt: skip
    _, told, _ = flight(tmp_path, *commands, maneuvers=True)
    refused, played = answers(told)[-2:]
    assert refused == ("flip_left", "the run ends: a person landed it")
    assert played == ("leds_red", None)


def test_by_the_compass_it_flies_as_by_its_own_axes(tmp_path):
    done, told, _ = flight(tmp_path, compass=1.5707963)  # the world's x axis points east
    assert done.summary["outcome"] == "succeeded", told
    assert done.summary["vehicles"]["a"]["position_error_m"]["mean"] < 0.1


def test_a_flood_of_acts_is_answered_and_ten_a_second_are_passed_on(tmp_path):
    commands = (asked(9.0 + 1e-4 * i, "perform a leds_fire") for i in range(300))
    done, told, _ = flight(tmp_path, *commands, asked(10.5, "perform a leds_red"))
    assert done.summary["outcome"] == "succeeded", told
    _, *flood, last = answers(told)
    why = "it was asked for 10 acts within a second"
    assert flood == [("leds_fire", None)] * 10 + [("leds_fire", why)] * 290
    assert last == ("leds_red", None)
