"""Makes the plan of a rehearsal: the mission on ideal vehicles.

Every driver becomes `kinematic`. Estimators become TrueState and trackers PassOn, with the names
and options of the originals. Sensors and faults are left out; if the mission has faults, so are the
expectations, which may be about them. Processors, supervisors, behaviors and flows stay. An input
that a person moves rests at its centre.
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
from kybflow.inputs.rows import InputRow, head, line
from kybflow.parts import Estimator, Tracker
from kybflow.world.vehicle_context import VehicleContext

RATE = 25
"""Control rate, Hz: high enough for ideal vehicles, as every finding lasts longer than a period."""
_KINDS = {
    SetpointKind.POSITION: CommandKind.POSITION,
    SetpointKind.VELOCITY: CommandKind.VELOCITY,
    SetpointKind.ACCELERATION: CommandKind.ACCELERATION,
}


class TrueState(Estimator[Any]):
    """Returns the vehicle's odometry, which is exact and without delay."""

    needs = frozenset({Odometry})

    def update(self, measurements: Sequence[Measurement], now: Time) -> Estimate | None:
        for one in measurements:
            if isinstance(one, Odometry):
                _, position, velocity, attitude, rates, _ = one
                return Estimate(now, position, velocity, attitude, rates, "truth", 0.0, 0.0)
        return None


class PassOn(Tracker[Any]):
    """Passes each setpoint on unchanged as a command."""

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
    """Return, for each input that a person moves, a recorded table with all axes centred, by input
    name."""
    found = {}
    for own in plan.inputs:
        if own.part.cls.real_time(own.part.params):
            axes = own.part.cls.axes(own.part.params)
            found[own.name] = head(axes) + line(InputRow(0, dict.fromkeys(axes, 0.0)), axes)
    return found


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
