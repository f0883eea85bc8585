"""A run folder as the engine would leave it, flown by formulas: two vehicles, an eight each."""

from __future__ import annotations

import math
import random
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace

from kybflow.api.flight import RunRequest
from kybflow.core.geometry import Vec3, distance, from_heading
from kybflow.core.signals import (
    NS,
    Battery,
    Command,
    Estimate,
    Event,
    Pose,
    Setpoint,
    SetpointKind,
    Truth,
)
from kybflow.drivers.sim import Sim, SimParams
from kybflow.dsl.plan import PartPlan, Plan, SourceFile, StatePlan, VehiclePlan
from kybflow.parts import AIR, GROUND, Behavior
from kybflow.recording.outcome import Ending, summarise
from kybflow.recording.recorder import Recorder
from kybflow.recording.run_folder import create_run_folder
from kybflow.runtime.expectations import Verdict
from kybflow.runtime.scores import Score
from kybflow.world.shapes import Box
from kybflow.world.vehicle_context import Airframe

STARTED = datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)
LEVEL = from_heading(0.0)
NO_ESTIMATORS = SimpleNamespace(candidates=(), source=None)
REST = (0.0, 0.0, 0.0)
STATES = (("up", "take_off"), ("steady", "hover"), ("eight", "figure_eight"), ("down", "land"))
LEGS = (GROUND >> AIR, AIR >> AIR, AIR >> AIR, AIR >> GROUND)
VERDICTS = (
    Verdict(
        "mean(mk.position_error in eight) < 1.7 cm", True, 0.0093, 0.0077, "m", "eight.yaml:31"
    ),
    Verdict(
        "max(nano.position_error in eight) < 1 mm", False, 0.0123, -0.0113, "m", "eight.yaml:36"
    ),
    Verdict("finished within 60 s", True, 28.0, 32.0, "s", "eight.yaml:39"),
)


def make_plan(*names: str, rate: int = 250) -> Plan:
    """A plan with everything that recorder, score and run folder look at."""
    return Plan(
        mission="figure_eight",
        summary="Two quadrotors trace <the same> eight.",
        target="sim",
        simulated=True,
        control_rate=rate,
        hover_limit=30.0,
        time_limit=600.0,
        fence=Box((-3.0, -3.0, 0.0), (3.0, 3.0, 2.5)),
        vehicles=tuple(_vehicle(name, place) for place, name in enumerate(names)),
        expectations=(),
        sources=(SourceFile("missions/figure_eight.yaml", "0" * 64),),
        resolved="kybflow: 1\nmission: figure_eight\n",
    )


def write_run(folder: Path, seconds: float = 28.0, seed: int = 0, rate: int = 250) -> Path:
    """Fill `folder` with a finished run and return it."""
    plan = make_plan("mk", "nano", rate=rate)
    run = create_run_folder(plan, folder, STARTED)
    run.describe(plan, RunRequest(seed).record(), STARTED)
    recorder, score = Recorder(run.log, plan), Score(plan)
    chance = random.Random(seed)
    starts = [0.0, 3.0, 5.0, seconds - 3.0]
    state = -1
    for tick in range(int(seconds * rate)):
        now = tick * NS // rate
        t = now / NS
        events = []
        if state + 1 < len(STATES) and t >= starts[state + 1]:
            state += 1
            events = _change(score, plan, state, now)
        for event in events:
            recorder.event(event)
            run.event(event)
        for vehicle in plan.vehicles:
            _fly(recorder, score, vehicle, t, now, starts, chance)
    for vehicle in plan.vehicles:
        score.vehicle(vehicle.name).left("done", seconds)
    recorder.close()
    summary = summarise(
        plan, score, VERDICTS, Ending(), seed=seed, sim_time_s=seconds, wall_time_s=0.9
    )
    run.finish(summary)
    return folder


def _vehicle(name: str, place: int) -> VehiclePlan:
    airframe = Airframe(
        mass=1.05, diameter=0.5, inertia=(0.011, 0.011, 0.02), thrust=6.0, rotor_time=0.05
    )
    nothing = PartPlan("nothing", object, None, "nothing")
    states = {
        state: StatePlan(state, PartPlan(part, Behavior, None, state), (leg,), ())
        for (state, part), leg in zip(STATES, LEGS, strict=True)
    }
    return VehiclePlan(
        name=name,
        airframe=airframe,
        start=(0.0, 2.0 * place - 1.0, 0.0),
        heading=0.0,
        tracker=nothing,
        driver=PartPlan("sim", Sim, SimParams(), "sim"),
        begin="up",
        states=states,
    )


def _change(score: Score, plan: Plan, state: int, now: int) -> list[Event]:
    events = []
    for vehicle in plan.vehicles:
        counted = score.vehicle(vehicle.name)
        if state:
            counted.left("done", now / NS)
            fields = {"behavior": STATES[state - 1][0], "how": "done"}
            events.append(Event(now, "behavior_ended", vehicle.name, fields, "eight.yaml:20"))
        else:
            counted.estimator("mocap", 0.0)
            counted.in_air(True, 0.0)
        name, part = STATES[state]
        counted.entered(name, part, now / NS)
        fields = {"behavior": name, "part": part}
        events.append(Event(now, "behavior_started", vehicle.name, fields, "eight.yaml:21"))
        if name == "steady":
            events.append(Event(now, "took_off", vehicle.name, {}))
        if name == "eight" and vehicle.name == "nano":
            fields = {"reaction": "warn", "value": 0.29, "bound": 0.3}
            events.append(Event(now, "battery_low", vehicle.name, fields, "eight.yaml:12"))
    return events


def _reference(start: Vec3, t: float, starts: list[float]) -> tuple[Vec3, Vec3]:
    x, y, _ = start
    if t < starts[1]:
        part = t / starts[1]
        return (x, y, part * part * (3 - 2 * part)), (0.0, 0.0, 6 * part * (1 - part) / starts[1])
    if t < starts[2]:
        return (x, y, 1.0), REST
    if t < starts[3]:
        angle = 2 * math.pi * (t - starts[2]) / 10.0
        place = (x + 0.73 * math.sin(angle), y + 0.365 * math.sin(2 * angle), 1.0)
        speed = 2 * math.pi / 10.0
        return place, (0.73 * speed * math.cos(angle), 0.73 * speed * math.cos(2 * angle), 0.0)
    return (x, y, max(0.0, 1.0 - (t - starts[3]) * 0.4)), (0.0, 0.0, -0.4)


def _fly(recorder, score, vehicle, t, now, starts, chance):
    channel, counted = recorder.vehicle(vehicle.name), score.vehicle(vehicle.name)
    place, velocity = _reference(vehicle.start, t, starts)
    wide = 0.012 if vehicle.name == "mk" else 0.008
    true = tuple(
        p + wide * math.sin(1.3 * t + i) + chance.gauss(0, 4e-4) for i, p in enumerate(place)
    )
    speed = tuple(v + 1.3 * wide * math.cos(1.3 * t + i) for i, v in enumerate(velocity))
    estimate = Estimate(now, true, speed, LEVEL, REST, "mocap", 0.012, 0.001)
    setpoint = Setpoint(SetpointKind.POSITION, place, velocity, REST, None, 0.0)
    command = Command(LEVEL, 10.3, REST, 0.0)
    truth = Truth(true, speed, LEVEL, REST)
    channel.tick(now, estimate, setpoint, setpoint, command, truth, NO_ESTIMATORS)
    counted.position.add(distance(place, true))
    counted.velocity.add(distance(velocity, speed))
    if now % (NS // 125) == 0:
        channel.measurement(now, Pose(now - 10_000_000, true, LEVEL))
    if now % NS == 0:
        battery = Battery(now, 1.0 - t / 900.0, 12.6 - 0.002 * t)
        channel.measurement(now, battery)
        counted.battery(battery.remaining)
