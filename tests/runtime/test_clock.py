"""The clocks: periods in whole nanoseconds, pacing, late ticks counted and never caught up."""

from kybflow.runtime.clock import SimulatedClock, TickCount, WallClock


class Wall:
    """A wall clock that only waiting or `pass_` moves; seconds."""

    def __init__(self) -> None:
        self.seconds = 100.0
        self.waited: list[float] = []

    def read(self) -> float:
        return self.seconds

    def read_ns(self) -> int:
        return round(self.seconds * 1e9)

    def wait(self, seconds: float) -> None:
        self.waited.append(seconds)
        self.seconds += seconds


def test_a_simulated_clock_runs_as_fast_as_it_is_asked():
    wall = Wall()
    clock = SimulatedClock(250, read=wall.read, wait=wall.wait)
    assert [clock.step() for _ in range(3)] == [4_000_000, 8_000_000, 12_000_000]
    assert wall.waited == []


def test_a_paced_clock_waits_for_the_wall():
    wall = Wall()
    clock = SimulatedClock(250, speed=2.0, read=wall.read, wait=wall.wait)
    for _ in range(500):
        clock.step()
    assert clock.now == 2_000_000_000
    assert abs(wall.seconds - 101.0) < 1e-6


def test_a_wall_clock_counts_and_leaves_out_the_ticks_that_it_missed():
    wall = Wall()
    clock = WallClock(250, read=wall.read_ns, wait=wall.wait)
    assert clock.step() == 4_000_000
    wall.seconds += 0.0175
    assert clock.step() == 20_000_000
    assert clock.missed == 3
    assert clock.step() == 24_000_000
    assert clock.missed == 3


def test_a_stop_while_a_wall_clock_sleeps_counts_in_the_tick_that_follows_it():
    wall = Wall()

    def wait(seconds: float) -> None:
        wall.wait(seconds + (0.4 if clock.now == 8_000_000 else 0.0001))

    clock = WallClock(250, read=wall.read_ns, wait=wait)
    assert clock.step() == 4_000_000
    assert clock.step() == 408_000_000
    assert clock.missed == 100
    assert clock.step() == 412_000_000
    assert clock.missed == 100


def test_the_ticks_of_each_second_are_counted_and_a_hang_belongs_to_its_second():
    wall = Wall()
    clock = WallClock(100, read=wall.read_ns, wait=wall.wait)
    ticks, told = TickCount(clock), []
    for busy in [0.0] * 100 + [0.0251] * 40 + [2.005]:
        wall.seconds += busy
        clock.step()
        if ticks.update():
            told.append((ticks.made, ticks.due))
    assert told == [(100, 100), (40, 100), (1, 200)]
    assert str(ticks) == "the computer made 1 of 200 ticks in 2.0 s"
