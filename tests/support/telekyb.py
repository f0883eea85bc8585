"""What the TeleKyb paper flew with (Grabe et al., ECMR 2013): its state from motion capture and its
standard position control, as parts of a lab's own. Source: github.com/aamirahmad/telekyb, commit
deedeeec, with its default options.

Neither knows a vehicle's drag or a delay: the state is the last pose with filtered derivatives,
and the law feeds the acceleration forward and nothing above it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from math import tau

from kybflow.core.geometry import Quat
from kybflow.core.params import param, params
from kybflow.core.signals import NS, Command, Estimate, Measurement, Pose, Setpoint, Tick, Time
from kybflow.core.units import Frequency
from kybflow.dsl.plan import EstimatorPlan, PartPlan, Plan, VehiclePlan
from kybflow.parts import Estimator
from kybflow.runtime.trackers.cascade import Cascade, CascadeParams
from kybflow.world.vehicle_context import VehicleContext

PERIOD = 1.0 / 120.0
"""Seconds between two poses, whatever their stamps say (`tViconSampleTime`)."""


class Derivative:
    """H(s) = w^2 s / (s + w)^2 by the bilinear transform (`IIRFilter` with `IIRFiltDeriv`, xi = 1).
    frequency: hertz."""

    def __init__(self, frequency: float, first: float) -> None:
        turn = tau * frequency * PERIOD
        whole = (2.0 + turn) ** 2
        self._gain = 2.0 * turn * turn / PERIOD / whole
        self._one, self._two = 2.0 * (turn * turn - 4.0) / whole, (2.0 - turn) ** 2 / whole
        self._inputs = deque([first, first], maxlen=2)
        self._outputs = deque([0.0, 0.0], maxlen=2)

    def step(self, value: float) -> float:
        (before, _), (y1, y2) = self._inputs, reversed(self._outputs)
        given = self._gain * (value - before) - self._one * y1 - self._two * y2
        self._inputs.append(value)
        self._outputs.append(given)
        return given


@params
class ViconParams:
    velocity: Frequency = param("`tViconVelFilterFreq`.", default=40.0)
    rates: Frequency = param("`tViconAngFilterFreq`.", default=30.0)


class Vicon(Estimator[ViconParams]):
    """`ViconStateEstimator`: nothing is predicted to now, nothing refused."""

    needs = frozenset({Pose})

    def __init__(self, params: ViconParams, context: VehicleContext) -> None:
        super().__init__(params, context)
        self._filters: list[Derivative] = []
        self._last: Estimate | None = None

    def update(self, measurements: Sequence[Measurement], now: Time) -> Estimate | None:
        for pose in measurements:
            if isinstance(pose, Pose):
                self._last = self._taken(pose)
        last = self._last
        return None if last is None else last._replace(time=now, age=(now - last.time) / NS)

    def _taken(self, pose: Pose) -> Estimate:
        values, p = (*pose.position, *pose.attitude), self.params
        if not self._filters:
            widths = (*[p.velocity] * 3, *[p.rates] * 4)
            self._filters = [Derivative(*pair) for pair in zip(widths, values, strict=True)]
        derived = [f.step(value) for f, value in zip(self._filters, values, strict=True)]
        vx, vy, vz, *turned = derived
        rates = _body_rates(pose.attitude, turned)
        return Estimate(
            pose.time, pose.position, (vx, vy, vz), pose.attitude, rates, "vicon", 0.0, 0.0
        )


def _body_rates(attitude: Quat, changes: Sequence[float]) -> tuple[float, float, float]:
    (w, x, y, z), (a, b, c, d) = attitude, changes
    return (
        2.0 * (w * b - x * a + z * c - y * d),
        2.0 * (w * c - y * a + x * d - z * b),
        2.0 * (w * d - z * a + y * b - x * c),
    )


class Standard(Cascade):
    """`StandardTrajectoryTracker`: `cascade` for a vehicle without drag and a setpoint without
    jerk."""

    def __init__(self, params: CascadeParams, context: VehicleContext) -> None:
        super().__init__(params, context._replace(airframe=replace(context.airframe, drag=0.0)))

    def update(self, setpoint: Setpoint, tick: Tick) -> Command:
        return super().update(setpoint._replace(jerk=None), tick)


GAINS = CascadeParams(proportional=9.0, derivative=7.5, integral=4.5, integral_limit=0.475, trim=0)
"""The paper's "same controller gains" for both vehicles: the defaults, with `tSatIntTerm`."""


def as_in_the_paper(plan: Plan, state: ViconParams | None = None) -> Plan:
    """The plan, each vehicle flown by what the paper flew with. It keeps its belief of the mass."""
    vicon = PartPlan("vicon", Vicon, state or ViconParams(), "estimators.vicon")
    return replace(plan, vehicles=tuple(_flown(vehicle, vicon) for vehicle in plan.vehicles))


def _flown(vehicle: VehiclePlan, vicon: PartPlan) -> VehiclePlan:
    gains = replace(GAINS, mass_guess=vehicle.tracker.params.mass_guess)
    law = PartPlan("standard", Standard, gains, "trackers.standard")
    return replace(vehicle, estimators=(EstimatorPlan(vicon, recover_after=1.0),), tracker=law)
