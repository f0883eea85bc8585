"""The plan of a rehearsal: the same mission on ideal vehicles.

Drivers become `kinematic`; estimators and trackers become those below, which know the truth and
pass each setpoint on, under the names and with the options of the mission's. Sensors and faults are
left out, and with faults the expectations, which may be about them; processors, supervisors,
behaviors and flows stay as they are. An input that a person moves rests at its centre.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from kybflow.core.geometry import LEVEL, ZERO
from kybflow.core.signals import (
    Command,
    CommandKind,
    Estimate,
    Measurement,
    Odometry,
    Setpoint,
    SetpointKind,
    Tick,
    Time,
)
from kybflow.drivers.kinematic import Kinematic, KinematicParams
from kybflow.dsl.plan import EstimatorPlan, PartPlan, Plan, VehiclePlan
from kybflow.parts import Estimator, Tracker
from kybflow.world.vehicle_context import VehicleContext

RATE = 25
"""Control rate, Hz: ideal vehicles miss nothing in between, and what goes wrong lasts longer."""
_KINDS = {
    SetpointKind.POSITION: CommandKind.POSITION,
    SetpointKind.VELOCITY: CommandKind.VELOCITY,
    SetpointKind.ACCELERATION: CommandKind.ACCELERATION,
}


class TrueState(Estimator[Any]):
    """The vehicle's odometry, which is exact and not late."""

    needs = frozenset({Odometry})

    def update(self, measurements: Sequence[Measurement], now: Time) -> Estimate | None:
        for one in measurements:
            if isinstance(one, Odometry):
                _, position, velocity, attitude, rates, _ = one
                return Estimate(now, position, velocity, attitude, rates, "truth", 0.0, 0.0)
        return None


class PassOn(Tracker[Any]):
    """Commands each setpoint as it is."""

    accepts = frozenset(_KINDS)
    emits = CommandKind.POSITION

    def __init__(self, params: Any, context: VehicleContext) -> None:
        super().__init__(params, context)
        self._hover = context.airframe.hover_thrust

    @property
    def hover_thrust(self) -> float:
        return self._hover

    def update(self, setpoint: Setpoint, tick: Tick) -> Command:
        return Command(LEVEL, self._hover, ZERO, None, True, _KINDS[setpoint.kind], setpoint)


def ideal(plan: Plan) -> Plan:
    """Return the plan that is rehearsed."""
    return replace(
        plan,
        simulated=True,
        watching={},
        control_rate=min(RATE, plan.control_rate),
        vehicles=tuple(_vehicle(vehicle) for vehicle in plan.vehicles),
        expectations=() if plan.faults else plan.expectations,
        faults=(),
    )


def at_rest(plan: Plan) -> dict[str, str]:
    """Return the record that stands in for each input that a person moves, by name: all axes
    centred."""
    return {
        own.name: _centred(own.part.cls.axes(own.part.params))
        for own in plan.inputs
        if own.part.cls.real_time(own.part.params)
    }


def _centred(axes: Sequence[str]) -> str:
    return f"t,{','.join(axes)},buttons,lost\n0,{','.join('0' for _ in axes)},,\n"


def _vehicle(vehicle: VehiclePlan) -> VehiclePlan:
    charge = getattr(vehicle.driver.params, "battery", 1.0)
    driver, first = vehicle.driver, vehicle.estimators[0].part
    return replace(
        vehicle,
        driver=PartPlan(
            "kinematic", Kinematic, KinematicParams(battery=charge), driver.label, driver.at
        ),
        estimators=(EstimatorPlan(part=replace(first, cls=TrueState)),),
        tracker=replace(vehicle.tracker, cls=PassOn),
        sensors=(),
    )
