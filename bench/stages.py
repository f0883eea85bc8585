"""Times the stages of a tick by wrapping the methods that the engine calls."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from time import process_time
from typing import Any

from kybflow.dsl.plan import Plan
from kybflow.recording.recorder import VehicleChannel
from kybflow.runtime.expectations import Judge
from kybflow.runtime.monitoring.tracking_errors import TrackingErrors


class Stages:
    """While entered, adds up the seconds in each stage of a flight of `plan`.

    overhead: seconds that the timing itself took.
    """

    def __init__(self, plan: Plan) -> None:
        self.seconds: dict[str, float] = defaultdict(float)
        self.calls = 0
        self._undo: list[tuple[type, str, Any]] = []
        self._methods = _methods(plan)

    def __enter__(self) -> Stages:
        for stage, cls, name in self._methods:
            method = getattr(cls, name)
            self._undo.append((cls, name, cls.__dict__.get(name)))
            setattr(cls, name, self._timed(stage, method))
        return self

    def __exit__(self, *_: object) -> None:
        for cls, name, method in reversed(self._undo):
            if method is None:
                delattr(cls, name)
            else:
                setattr(cls, name, method)

    @property
    def overhead(self) -> float:
        return self.calls * _cost()

    def _timed(self, stage: str, method: Callable[..., Any]) -> Callable[..., Any]:
        seconds = self.seconds

        def timed(*arguments: Any) -> Any:
            began = process_time()
            result = method(*arguments)
            seconds[stage] += process_time() - began
            self.calls += 1
            return result

        return timed


def _methods(plan: Plan) -> list[tuple[str, type, str]]:
    from kybflow.drivers.sim.vehicle import SimulatedVehicle
    from kybflow.drivers.sim.world import SimulatedWorld

    found: dict[tuple[str, type, str], None] = {
        ("simulator: physics, sensors, on-board control", SimulatedWorld, "advance"): None,
        ("link: measurements, truth, command", SimulatedVehicle, "read"): None,
        ("link: measurements, truth, command", SimulatedVehicle, "truth"): None,
        ("link: measurements, truth, command", SimulatedVehicle, "send"): None,
        ("recorder", VehicleChannel, "tick"): None,
        ("recorder", VehicleChannel, "measurement"): None,
        ("score and expectations", TrackingErrors, "update"): None,
        ("score and expectations", Judge, "sample"): None,
    }
    for vehicle in plan.vehicles:
        for estimator in vehicle.estimators:
            found["estimator", estimator.part.cls, "update"] = None
        for state in vehicle.states.values():
            found["behavior", state.behavior.cls, "update"] = None
        for processor in vehicle.processors:
            found["processors", processor.cls, "__call__"] = None
        for supervisor in vehicle.supervisors:
            found["supervisors", supervisor.cls, "check"] = None
        found["tracker", vehicle.tracker.cls, "update"] = None
    return list(found)


def _cost(rounds: int = 20_000) -> float:
    """Seconds that one timed call costs more than the call itself."""
    began = process_time()
    for _ in range(rounds):
        _nothing()
    plain = process_time() - began
    stages = Stages.__new__(Stages)
    stages.seconds, stages.calls = defaultdict(float), 0
    wrapped = stages._timed("", _nothing)
    began = process_time()
    for _ in range(rounds):
        wrapped()
    return max(0.0, process_time() - began - plain) / rounds


def _nothing() -> None:
    """A call to take the cost of."""
