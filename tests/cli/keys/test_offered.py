"""Which key means which command."""

from __future__ import annotations

from dataclasses import replace

from kybflow.cli.keys import FIXED, KEYS, OfferedKeys
from kybflow.dsl.plan import Emit, Stop, Switch
from kybflow.runtime.commanding.orders import LandOrder, PauseOrder, ResetOrder, ResumeOrder
from kybflow.runtime.commanding.situation import FlowSituation, Situation, VehicleSituation

NO = "not now"


def vehicle(name: str, state: str, enter: dict[str, str | None], **facts) -> VehicleSituation:
    legal = {"pause": None, "resume": NO, "reset": NO, "land": None, "latched": None}
    nothing = dict.fromkeys(
        ("braking", "override", "retired", "driver", "battery", "estimate", "setpoint")
    )
    seen = {"behavior": "hover", "flight": "air", "elapsed": 1.0, "holders": (), "waits_for": ()}
    return VehicleSituation(
        name=name, state=state, enter=enter, **{**seen, **legal, **nothing, **facts}
    )


def situation(*vehicles, flows=(), emit=None) -> Situation:
    return Situation("eight", 1.5, True, None, vehicles, tuple(flows), emit or {})


def offered(keys: OfferedKeys, seen: Situation, now: float = 0.0) -> dict[str, str]:
    return {f"{o.group} {o.name}".strip(): o.key for o in keys.assign(seen, now)}


HOLD = vehicle("a", "hold", {"hold": None, "go": None, "down": NO, "landed": None, "hover": None})


def test_what_is_legal_is_offered_with_its_key() -> None:
    team = FlowSituation("team", "wait", 1.0, ("a",), (), {"wait": None, "dance": None})
    seen = situation(HOLD, flows=(team,), emit={"operator.go": True, "ready": False})
    assert offered(OfferedKeys(), seen) == {
        "pause": "p",
        "land": "l",
        "stop": "s",
        "events operator.go": "1",
        "a go": "4",
        "a hover": "6",
        "team dance": "8",
    }


def test_each_key_gives_its_command() -> None:
    found = OfferedKeys().assign(situation(HOLD, emit={"ready": True}), 0.0)
    switches = [Switch("a", "go"), Switch("a", "hover")]
    orders = [offer.order for offer in found]
    assert orders == [PauseOrder(), LandOrder(), Stop(""), Emit("ready"), *switches]


def test_a_paused_vehicle_can_be_resumed_and_one_in_fault_reset() -> None:
    paused = replace(HOLD, holders=("pause",), resume=None)
    lost = vehicle("b", "fault", {}, pause=NO, reset=None, retired="landed")
    found = OfferedKeys().assign(situation(paused, lost), 0.0)
    orders = [offer.order for offer in found[:4]]
    assert orders == [LandOrder(), ResumeOrder(), ResetOrder(), Stop("")]


def test_what_the_mission_waits_for_of_a_fixed_key_is_offered_there() -> None:
    found = offered(OfferedKeys(), situation(HOLD, emit={"operator.resume": True}))
    assert found["resume"] == "r"
    assert "events operator.resume" not in found


def test_before_the_flight_it_can_only_be_stopped() -> None:
    early = vehicle("a", "", {"go": NO}, pause=NO, land=NO)
    assert offered(OfferedKeys(), situation(early)) == {"stop": "s"}


def test_a_chain_is_offered_by_its_name() -> None:
    chain = vehicle("a", "hold", {"hold": None, "tour.there": None, "tour.back": NO})
    assert "a tour" in offered(OfferedKeys(), situation(chain))


def test_a_key_keeps_its_meaning() -> None:
    keys = OfferedKeys()
    first = offered(keys, situation(HOLD))
    gone = replace(HOLD, enter=dict.fromkeys(HOLD.enter, NO))
    assert offered(keys, situation(gone, emit={"ready": True}), 100.0)["events ready"] == "5"
    assert offered(keys, situation(HOLD), 101.0).items() >= first.items()


def test_where_the_keys_are_used_up_one_changes_only_after_a_rest() -> None:
    states = dict.fromkeys((f"s{number}" for number in range(len(KEYS))), NO)
    many = vehicle("a", "up", {**states, "s0": None, "s1": None, "up": None})
    last = vehicle("b", "up", {"go": None})
    keys = OfferedKeys(rest=10.0)
    begun = offered(keys, situation(many, last), 0.0)
    assert begun["a s0"] == KEYS[0]
    assert begun["b go"] == KEYS[2], "no vehicle could enter s2 so far"
    full = replace(many, enter=dict.fromkeys(many.enter))
    assert offered(keys, situation(full, last), 1.0)["a s2"] == ""
    less = replace(full, enter={**full.enter, "s0": NO})
    assert offered(keys, situation(less, last), 11.0)["a s2"] == ""
    assert offered(keys, situation(less, last), 11.5)["a s2"] == KEYS[0]
    assert offered(keys, situation(less, last), 11.5)["b go"] == KEYS[2]


def test_no_key_is_of_two() -> None:
    assert len({*KEYS, *FIXED}) == len(KEYS) + len(FIXED)
