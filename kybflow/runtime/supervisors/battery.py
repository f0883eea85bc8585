"""Report a battery that runs low, first with a warning, then with a landing, or stops reporting.

Alarm `battery_low` with WARN below `warn_below`, and in the air with `reaction` (a landing by
default) below `land_below`; on the ground there is only the warning. Each stays until the charge is
5 % (of full) above its bound again, so that it does not flutter with a battery that sags under
load. The vehicle's own battery warning raises the alarm too, with its text: with WARN, or in the
air with `reaction` if the vehicle's own failsafe would act, whether that is enabled or not. There
is no alarm without a battery report.

Alarm `battery_lost` with WARN while the newest report is older than `age`: the charge is unknown,
and the bounds above apply to the last report. `battery_low` takes precedence. The value is the age
in seconds.

An alarm that persists is returned in every tick; the failsafe makes one event of it, and a separate
event of the landing. The value of `battery_low` is the charge left, 0 to 1.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from kybflow.core.signals import NS, Alarm, BatteryWarning, Reaction, ReactionName, Tick
from kybflow.core.units import Duration, Ratio
from kybflow.parts import Objection, Supervisor, param, params
from kybflow.world.vehicle_context import VehicleContext

_RECOVERY, _WARNING = 0.05, 0.3
_USUAL_CHARGE, _COLLAPSE_CHARGE = 0.95, 0.04
"""Charge (0 to 1) that a battery has after a minute of flight, and at which its voltage
collapses."""


@params
class BatterySupervisorParams:
    warn_below: Ratio = param(
        "Charge below which a warning is raised.",
        default=_WARNING,
        at_least=0.0,
        at_most=1.0,
        tightens="up",
    )
    land_below: Ratio = param(
        "Charge below which the vehicle lands.",
        default=0.15,
        at_least=0.0,
        at_most=1.0,
        tightens="up",
    )
    age: Duration = param(
        "Age of the newest report above which a warning is raised.",
        default=5.0,
        above=0.0,
        tightens="down",
    )
    reaction: ReactionName = param(
        "What the failsafe does below `land_below`.", default="land", tightens="up"
    )


class BatterySupervisor(Supervisor[BatterySupervisorParams]):
    always = True
    unhurried = True
    events = ("battery_low", "battery_lost")

    @classmethod
    def ends_outside(cls, params: BatterySupervisorParams) -> Mapping[str, tuple[float, float]]:
        ends = Reaction[params.reaction.upper()] > Reaction.BRAKE
        return {"battery.remaining": (params.land_below, 1.0)} if ends else {}

    @classmethod
    def objections(
        cls, params: BatterySupervisorParams, context: VehicleContext
    ) -> Iterator[Objection]:
        p = params
        if p.land_below >= _USUAL_CHARGE:
            reason = "alarms at once: no battery stays that full in flight"
            yield Objection("land_below", reason, "write `land_below: 15 %`", p.reaction == "warn")
        if p.land_below < _COLLAPSE_CHARGE:
            reason = f"alarms below {p.land_below:.0%}, where a battery no longer holds the vehicle"
            yield Objection("land_below", reason, "write `land_below: 15 %`", is_doubt=True)
        if p.warn_below < p.land_below and p.warn_below != _WARNING:
            reason = f"warns only when the vehicle already lands, below {p.land_below:.0%}"
            hint = "write a `warn_below` above `land_below`"
            yield Objection("warn_below", reason, hint, is_doubt=True)

    def __init__(self, params: BatterySupervisorParams, context: VehicleContext) -> None:
        super().__init__(params, context)
        self._low = False
        self._empty = False

    @classmethod
    def reserve(cls, params: BatterySupervisorParams) -> float:
        return 0.0 if Reaction[params.reaction.upper()] is Reaction.WARN else params.land_below

    def check(self, tick: Tick, off_ground: bool) -> Alarm | None:
        if tick.battery is None:
            return None
        left, p = tick.battery.remaining, self.params
        self._low = left < p.warn_below + (_RECOVERY if self._low else 0.0)
        self._empty = left < p.land_below + (_RECOVERY if self._empty else 0.0)
        warning: BatteryWarning | None = tick.battery.warning
        if self._empty and off_ground:
            reason = f"{left:.0%} left, below {p.land_below:.0%}"
            return Alarm("battery_low", Reaction[p.reaction.upper()], reason, left, p.land_below)
        if warning is not None and (warning.acts or not self._low):
            acts = warning.acts and off_ground
            reaction = Reaction[p.reaction.upper()] if acts else Reaction.WARN
            return Alarm("battery_low", reaction, f"{warning.words}; {left:.0%} left", left)
        if self._low or self._empty:
            bound = max(p.warn_below, p.land_below) if self._low else p.land_below
            return Alarm(
                "battery_low", Reaction.WARN, f"{left:.0%} left, below {bound:.0%}", left, bound
            )
        age = (tick.now - tick.battery.time) / NS
        if age > p.age:
            reason = f"its last report is {age:.1f} s old, {p.age:g} s allowed"
            return Alarm("battery_lost", Reaction.WARN, reason, age, p.age)
        return None
