"""A person with a transmitter, or with a keyboard; and rotors that are cut."""

from __future__ import annotations

import pytest

pytest.importorskip("pymavlink", reason="pymavlink is not installed")

from dry_runs import (
    DRIVER,
    FOLLOWS,
    HEIGHT,
    LANDS,
    LINE,
    WRONG,
    DryRun,
    supervised,
)
from framing import REQUEST
from short_flights import NoParams

from kybflow.core.signals import NS, Alarm, Reaction
from kybflow.drivers.mavlink.protocol.framing import NUMBERS
from kybflow.dsl.plan import PartPlan
from kybflow.parts import Supervisor

SWITCH = {"px4": ("POSCTL", "POSITION"), "ardupilot": ("LOITER", "LOITER")}
"""The pilot's mode as the emulated firmware and as the driver call it."""
BACK = WRONG + 2.0
thorough = pytest.mark.thorough


def switches(flight):
    """The pilot's, with what is sent to the vehicle from then on counted, but for requests for its
    messages."""
    wire, sent = flight.link.wire, []
    flight.sent = sent
    send = wire._send

    def counting(data, to):
        number, command = (int.from_bytes(data[a:b], "little") for a, b in ((7, 10), (38, 40)))
        if (number, command) != (NUMBERS["COMMAND_LONG"], REQUEST):
            sent.append((flight.engine.seconds(), number))
        send(data, to)

    wire._send = counting
    flight.pilot.give_to_pilot(SWITCH[flight.name][0])


SET_POINTS = {
    NUMBERS[f"SET_{name}"]
    for name in ("ATTITUDE_TARGET", "POSITION_TARGET_LOCAL_NED", "POSITION_TARGET_GLOBAL_INT")
}
COMMANDS = {NUMBERS["COMMAND_LONG"]}
"""Numbers of the messages that steer."""


@pytest.mark.parametrize("autopilot", [pytest.param("px4", marks=thorough), "ardupilot"])
def test_a_pilot_has_it_at_once_and_until_it_is_asked_for(autopilot, tmp_path):
    deeds, resume = [(WRONG, switches)], (BACK, "operator.resume")
    flight = DryRun(autopilot, tmp_path, deeds=deeds, emitted=[resume])
    taken = flight.only("control_taken")
    assert (taken.at, taken.fields["reason"]) == (
        DRIVER,
        f"a pilot took over: {SWITCH[autopilot][1]}",
    )
    assert flight.at("control_taken") - WRONG < 0.03
    between = {n for at, n in flight.sent if flight.at("control_taken") <= at < BACK}
    assert not between & (SET_POINTS | COMMANDS)
    assert 0.0 <= flight.at("control_returned") - BACK < 1.5
    assert flight.path == ["up", "hold", "down", "landed"]
    assert flight.flown.exit_code == 0
    assert flight.is_safe()


@pytest.mark.parametrize("autopilot", ["px4", pytest.param("ardupilot", marks=thorough)])
def test_a_pilot_who_lands_it_ends_the_run(autopilot, tmp_path):
    def lands(flight):
        flight.pilot.change(flight.pilot.firmware.land, flight.pilot.now, asked=True)

    deeds = [(WRONG, switches), (WRONG + 0.5, lands)]
    flight = DryRun(autopilot, tmp_path, deeds=deeds)
    assert flight.path == ["up", "hold", "landed"]
    assert "a pilot took over" in flight.flown.summary["reason"]
    assert flight.flown.exit_code == 1
    assert flight.is_safe()


def interrupted(times):
    return lambda flight: setattr(flight.engine, "interrupts", times)


@pytest.mark.parametrize("autopilot", ["px4", pytest.param("ardupilot", marks=thorough)])
def test_ctrl_c_lands_it_by_its_own_mode(autopilot, tmp_path):
    flight = DryRun(autopilot, tmp_path, deeds=[(WRONG, interrupted(1))])
    assert flight.only("land_mode_started").at == DRIVER
    assert flight.after(WRONG, LANDS[autopilot]) < 0.15
    assert flight.flown.exit_code == 130
    assert flight.is_safe()


@pytest.mark.parametrize("autopilot", [pytest.param("px4", marks=thorough), "ardupilot"])
def test_a_second_ctrl_c_cuts_the_stream_and_it_lands_by_itself(autopilot, tmp_path):
    deeds = [(WRONG, interrupted(2))]
    flight = DryRun(autopilot, tmp_path, deeds=deeds)
    assert flight.mode == {"px4": "OFFBOARD", "ardupilot": "GUIDED"}[autopilot]
    assert flight.pilot.state.armed
    flight.go_on(20.0)
    assert flight.after(WRONG, LANDS[autopilot]) < 2.1
    assert flight.flown.exit_code == 130
    assert flight.is_safe()


@pytest.mark.parametrize("autopilot", ["px4", pytest.param("ardupilot", marks=thorough)])
def test_who_disarms_it_in_its_landing_has_not_landed_it(autopilot, tmp_path):
    """It is down before its heartbeat says that its rotors rest."""

    def stops(flight):
        flight.pilot.stop(flight.pilot.now, "Disarmed by external command")

    def watches(flight):
        if flight.path[-1] == "down" and flight.position[2] < 0.4:
            stops(flight)
        else:
            flight.do_next(watches)

    flight = DryRun(autopilot, tmp_path, deeds=[(WRONG, watches)])
    assert flight.path == ["up", "hold", "down", "fault"]
    assert "it disarmed in the air" in flight.only("control_lost").fields["reason"]
    assert flight.events("landed") == []
    assert flight.flown.exit_code == 1


class Cuts(Supervisor[NoParams]):
    """Asks for `cut` from `WRONG` on."""

    def check(self, tick, airborne):
        wrong = WRONG * NS <= tick.now < (WRONG + 0.2) * NS
        return Alarm("alarmed", Reaction.CUT, "the test says so") if wrong else None


@pytest.mark.parametrize("autopilot", ["px4", pytest.param("ardupilot", marks=thorough)])
def test_cut_stops_its_rotors_in_the_air(autopilot, tmp_path):
    alarm = PartPlan("cuts", Cuts, NoParams(), "supervisors.cuts", LINE)
    flight = DryRun(autopilot, tmp_path, supervisors=(*supervised(), alarm))
    first = next(s for s in flight.samples if s.time >= WRONG and not s.armed)
    assert first.time - WRONG <= 0.06
    assert first.position[2] > 0.8 * HEIGHT
    assert (first.mode, flight.only("failsafe_started").at) == (FOLLOWS[autopilot], LINE)
    assert flight.path == ["up", "hold", "fault"]
