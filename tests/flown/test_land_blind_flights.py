"""land_blind in the simulator: gentle with a wrong thrust, in wind, with a wrong IMU, anywhere."""

from __future__ import annotations

from dataclasses import replace
from math import hypot, sqrt
from typing import ClassVar, NamedTuple

import pytest
from plans import part
from short_flights import fault, hovers, named, path
from toolchain import compiled, flight_of, with_library

from kybflow.core.signals import NS, Imu, Truth
from kybflow.drivers.sim import Sim
from kybflow.dsl.plan import EstimatorPlan
from kybflow.flight.descent import Descent
from kybflow.parts import Effect

LOST = 9.0
MOCAP = part("estimators", "mocap")
KINDS = {
    "nothing": [],
    "heavy": [("mass_change", {"factor": 1.1})],
    "light": [("mass_change", {"factor": 0.9})],
    "bias down": [("imu_bias_step", {"accelerometer": (0.1, 0.1, -0.15)})],
    "bias up": [("imu_bias_step", {"accelerometer": (0.1, 0.1, 0.15)})],
    "wind": [("wind", {"velocity": (1.5, 0.0, 0.0)})],
    "gust and heavy": [("gust", {"velocity": (2.0, 1.0, 0.0)}), ("mass_change", {"factor": 1.1})],
    "rotor": [("rotor_weak", {"left": 0.85})],
}
"""What happens when the estimate is lost: thrust 10 % too weak or too strong, air, a bad IMU."""
QUICK = frozenset({"nothing", "gust and heavy"})


class Landing(NamedTuple):
    """rose: above the lowest point before, m."""

    speed: float
    seconds: float
    climbed: float
    rose: float


class Watch:
    """The truth of every tick of a vehicle in `land_blind`."""

    def __init__(self) -> None:
        self.seen: list[tuple[float, Truth]] = []

    def __call__(self, engine) -> None:
        flying = engine.vehicles[0]
        if engine.flying and flying.runner.machine.state == "land_blind":
            self.seen.append((engine.seconds(), flying.truth))

    def landing(self) -> Landing:
        first, last = self.seen[0], self.seen[-1]
        top = max(truth.position[2] for _, truth in self.seen) - first[1].position[2]
        fastest = -min(truth.velocity[2] for _, truth in self.seen)
        low, rose = first[1].position[2], 0.0
        for _, truth in self.seen:
            low = min(low, truth.position[2])
            rose = max(rose, truth.position[2] - low)
        return Landing(fastest, last[0] - first[0], top, rose)


@pytest.fixture(autouse=True)
def _every_tick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("kybflow.runtime.engine._OBSERVED_EVERY", 1)


def landed(run, kind: str, height: float, seed: int, **sim: float) -> Landing:
    faults = [fault("mocap_dropout", LOST)]
    faults += [fault(name, LOST + 0.2, **params) for name, params in KINDS[kind]]
    watch, driver = Watch(), part("drivers", "sim", **sim)
    flier = hovers(30.0, height=height, driver=driver)
    _, told = run(flier, seed=seed, faults=tuple(faults), observers=(watch,))
    assert path(told, "a")[-2:] == ["land_blind", "fault"]
    assert len(named(told, "landed")) == 1
    return watch.landing()


def held(landing: Landing) -> bool:
    """The figures that the page of failsafes promises."""
    return landing.speed <= 1.5 and landing.climbed <= 0.1 and landing.seconds < 11.0


@pytest.mark.parametrize(
    "kind",
    [k if k in QUICK else pytest.param(k, marks=pytest.mark.thorough) for k in KINDS],
)
def test_it_lands_gently_from_a_metre(run, kind: str) -> None:
    landing = landed(run, kind, 1.0, seed=1)
    assert held(landing), landing


@pytest.mark.slow
@pytest.mark.parametrize("height", [0.5, 1.0, 1.8])
@pytest.mark.parametrize("kind", KINDS)
def test_it_lands_gently_from_everywhere_with_every_seed(run, kind: str, height: float) -> None:
    landings = [landed(run, kind, height, seed) for seed in range(10)]
    assert all(map(held, landings)), landings


@pytest.mark.parametrize(
    "seed",
    [
        300,
        pytest.param(301, marks=pytest.mark.thorough),
        *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(400, 420)),
    ],
)
def test_in_the_noise_of_px4s_simulator_it_does_not_rise_again(run, seed: int) -> None:
    """Samples of 1.4 m/s^2 along z at 100 Hz make the speed wander as these at 500 Hz do."""
    landing = landed(run, "nothing", 1.0, seed, accelerometer_noise=1.4 * sqrt(5.0))
    assert landing.rose <= 0.1, landing
    assert landing.speed <= 1.5, landing


def test_lost_while_it_climbs_it_lands(run) -> None:
    watch = Watch()
    lost = fault("mocap_dropout", 2.5)
    run(hovers(30.0, height=1.8), faults=(lost,), observers=(watch,))
    landing = watch.landing()
    assert landing.speed <= 1.5
    assert landing.climbed <= 0.3


class Loses(MOCAP.cls):
    """Motion capture that has no estimate any more from `at` seconds on."""

    at: ClassVar[float]

    def update(self, measurements, now):
        estimate = super().update(measurements, now)
        return estimate if now < self.at * NS else None


@pytest.mark.parametrize(
    ("lost", "least"), [pytest.param(2.507, 0.2, marks=pytest.mark.thorough), (9.507, -0.7)]
)
def test_it_begins_at_the_speed_at_which_the_estimate_was_lost(run, monkeypatch, lost, least):
    """It is lost in a tick in which the vehicle needs it and no supervisor looks."""
    begun: list[float] = []

    def noted(hover: float, most: float, climb: float, rest: float, late: float) -> Descent:
        begun.append(climb)
        return Descent(hover, most, climb, rest, late=late)

    monkeypatch.setattr("kybflow.runtime.behaviors.land_blind.Descent", noted)
    monkeypatch.setattr(Loses, "at", lost, raising=False)
    sees = EstimatorPlan(replace(MOCAP, cls=Loses), recover_after=1.0)
    watch = Watch()
    run(hovers(1.0, height=1.8, estimators=(sees,)), observers=(watch,))
    true = watch.seen[0][1].velocity[2]
    assert least < true < least + 0.5
    assert begun == [pytest.approx(true, abs=0.1)]


@pytest.mark.thorough
def test_one_that_is_not_heard_and_loses_its_load_comes_down_by_its_own_watchdog(run) -> None:
    watch = Watch()
    cut = fault("link_cut", LOST, way="from_vehicle")
    lighter = fault("mass_change", LOST + 0.3, factor=0.6)
    flier = hovers(30.0, height=1.0, driver=part("drivers", "sim", calm=True))
    _, told = run(flier, faults=(cut, lighter), observers=(watch,))
    [waits] = named(told, "behavior_waits")
    assert waits.fields["reason"] == "its own watchdog, because the link is silent"
    assert watch.landing().climbed < 2.5
    assert watch.landing().speed < 1.5
    assert watch.seen[-1][1].position[2] < 0.05


class Feels(MOCAP.cls):
    """Motion capture, by an estimator that has the IMU too, on the ground already."""

    needs = MOCAP.cls.needs | {Imu}


class Biased(Sim):
    """Its accelerometers are wrong by `error` along body z from the beginning."""

    error: ClassVar[float]

    @classmethod
    def open(cls, seats, generator):
        session = super().open(seats, generator)
        session.links["a"].faults.begin(Effect(accelerometer_bias=(0.0, 0.0, cls.error)), 0)
        return session


def biased(run, error: float, factor: float, estimator=Feels) -> Landing:
    """From a metre, the thrust wrong by `factor`, the accelerometer by `error`."""
    sim = type("Biased", (Biased,), {"error": error})
    faults = fault("mass_change", LOST + 0.2, factor=factor), fault("mocap_dropout", LOST)
    watch = Watch()
    one = hovers(
        30.0,
        height=1.0,
        driver=replace(part("drivers", "sim"), cls=sim),
        estimators=(EstimatorPlan(replace(MOCAP, cls=estimator), recover_after=1.0),),
    )
    _, told = run(one, faults=faults, observers=(watch,))
    assert path(told, "a")[-2:] == ["land_blind", "fault"]
    return watch.landing()


@pytest.mark.parametrize(
    ("error", "factor"),
    [
        pytest.param(
            error,
            factor,
            marks=()
            if (error, factor) == (1.0, 1.1)
            else pytest.mark.thorough
            if abs(error) == 1.0
            else pytest.mark.slow,
        )
        for error in (-1.0, -0.4, 0.4, 1.0)
        for factor in (0.9, 1.1)
    ],
)
def test_what_the_imu_felt_at_rest_is_no_error_any_more(run, error: float, factor: float) -> None:
    landing = biased(run, error, factor)
    assert held(landing), landing


@pytest.mark.thorough
def test_where_nothing_was_felt_at_rest_that_error_holds_it_up(run) -> None:
    assert biased(run, -1.0, 0.9, MOCAP.cls).climbed > 0.3


AT_A_WALL = """
kybflow: 1
mission: at_a_wall
import: {std: kybflow/airframes}
world:
  fence: {from: [-2, -2, 0], to: [3, 2, 2.5]}
  obstacles: {wall: {plane: {at: [1.9, 0, 0], facing: [-1, 0, 0]}}}
vehicles:
  v:
    like: std.nano_plus
    start: {at: [0, 0, 0]}
    behaviors:
      up:   {do: take_off, height: 1.5 m, then: go}
      go:   {do: fly_to, position: [1.4, 0, 1.5], speed: 1 m/s, then: down, failed: down}
      down: {do: land}
faults:
  - {when: behavior == go and state.x > 50 cm, on: v, inject: mocap_dropout}
  - {when: behavior == land_blind and elapsed > 700 ms, on: v, inject: gust, velocity: [3, 0, 0]}
"""


@pytest.mark.thorough
@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2, 3))]
)
def test_it_brakes_first_and_the_touch_of_a_wall_is_not_the_floor(tmp_path, seed: int) -> None:
    watch = Watch()
    plan = compiled(tmp_path / "mission.yaml", AT_A_WALL, warns=True)
    _, told = flight_of(plan, tmp_path / "run", watch, seed=seed)
    begun, first = watch.seen[0]
    braked = next(truth for time, truth in watch.seen if time > begun + 0.69)
    assert first.velocity[0] > 0.6
    assert braked.velocity[0] < 0.6 * first.velocity[0]
    [into, *_] = named(told, "collided")
    [landed_at] = named(told, "landed")
    assert landed_at.time > into.time + 0.3 * NS
    assert abs(watch.seen[-1][1].position[2]) < 0.02


OFF_LEVEL = """\
kybflow: 1
mission: off_level
import: {std: library/airframes.yaml}
world: {fence: {from: [-2, -2, 0], to: [2, 2, 2.5]}}
vehicles:
  nano:
    like: std.nano_plus
    start: {heading: 130 deg}
    behaviors:
      up: {do: take_off, height: 1 m, then: stay}
      stay: {do: hover, for_time: 20 s, then: down}
      down: {do: land}
targets:
  sim: {nano: {driver: {use: sim, mocap_misalignment: 3 deg, wind: WIND}}}
faults:
  - {at: 12 s, on: nano, inject: estimator_killed, estimator: mocap}
"""


@pytest.mark.parametrize(
    ("seed", "wind"),
    [(0, "[0, 0, 0]"), (1, "[1.5, -0.5, 0]"), *(
        pytest.param(seed, "[0, 0, 0]", marks=pytest.mark.thorough) for seed in (2, 3, 4)
    )],
)  # fmt: skip
def test_it_leans_as_the_tracker_did_to_stand_still(seed, wind, tmp_path):
    """Level itself would let it drift aside by 0.4 m for each degree that it is off."""
    with_library(tmp_path)
    plan = compiled(tmp_path / "off.yaml", OFF_LEVEL.replace("WIND", wind), warns=True)
    watch = Watch()

    flight_of(plan, tmp_path / "run", watch, seed=seed)

    (x, y, _), (u, v, _) = (watch.seen[at][1].position for at in (0, -1))
    moved = hypot(u - x, v - y)
    assert moved < 0.35
