"""A drone plays its LEDs and is calibrated in flight, asked by the mission or by a person, and is
told why not."""

from __future__ import annotations

from ardrone_flights import drone_flight, mission

from kybflow.api.flight import RunRequest
from kybflow.core.geometry import heading_of
from kybflow.core.signals import NS
from kybflow.drivers.ardrone.acts import CALIBRATE
from kybflow.runtime.commanding.command_queue import RecordedCommand

ON = """on:
  - {event: a.took_off, do: [{perform: {a: leds_blink_green}}]}
"""


def asked(seconds, words):
    return RecordedCommand(round(seconds * NS), words, "alice", False)


def flight(folder, *commands, **params):
    request = RunRequest(out=folder / "run", again=commands)
    return drone_flight(mission(["a"], 6.0) + ON, folder, request=request, wifi_loss=0.0, **params)


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


def test_with_permission_it_flips_in_flight_alone_and_flies_on(tmp_path):
    commands = (asked(2.5, "perform a flip_left"), asked(9.0, "perform a flip_left"),
                asked(9.5, "perform a roll_dance"))  # fmt: skip
    done, told, session = flight(tmp_path, *commands, maneuvers=True)
    assert done.summary["outcome"] == "succeeded", told
    assert answers(told) == [
        ("flip_left", "it doesn't fly"),
        ("leds_blink_green", None),
        ("flip_left", None),
        ("roll_dance", "it still performs an act"),
    ]
    assert session.links["a"].drone.configuration.values["control:flight_anim"] == "18,15"
    assert "control_lost" not in [event.name for event in told]


def test_it_turns_once_to_calibrate_its_magnetometer_and_flies_on(tmp_path):
    room = "processors: [{use: position_error, limit: 1.5 m}]\n    behaviors:"
    text = mission(["a"], 6.0).replace("behaviors:", room)
    circle = "do: circle, center: [-1.5, 0.5, 1], radius: 50 cm, speed: 40 cm/s, laps: 1"
    text = text.replace(circle, "do: hover, for_time: 12 s")
    request = RunRequest(out=tmp_path / "run", again=(asked(9.0, f"perform a {CALIBRATE}"),))
    watch = []
    done, told, _ = drone_flight(text, tmp_path, request=request, watch=watch, maneuvers=True)
    assert done.summary["outcome"] == "succeeded", told
    assert answers(told) == [(CALIBRATE, None)]
    headings = [heading_of(true.attitude) for seconds, true in watch if 9.0 < seconds < 16.0]
    assert {round(heading) for heading in headings} == {-3, -2, -1, 0, 1, 2, 3}
    assert abs(headings[-1]) < 0.3


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
