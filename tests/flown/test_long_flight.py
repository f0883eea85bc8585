"""Ten minutes of four vehicles: memory stays flat; and a run that is killed leaves its record."""

import random
import resource
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from plans import part, plan, state, then, vehicle
from short_flights import down, up

from kybflow.api.flight import RunRequest, fly
from kybflow.core.signals import NS
from kybflow.recording.messages import read_recording

HERE = Path(__file__).parent
STARTS = ((-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (-1.0, 1.0, 0.0), (1.0, 1.0, 0.0))


def circling(minutes: float):
    vehicles = []
    for index, start in enumerate(STARTS):
        center = (start[0], start[1], 1.0)
        laps = minutes * 60 / 5.03
        circle = part("behaviors", "circle", center=center, radius=0.4, laps=laps)
        states = [up("round", 1.0), state("round", circle, then("down")), down()]
        vehicles.append(vehicle(f"v{index}", states, start=start))
    return plan(*vehicles, time_limit=minutes * 60 + 60)


@pytest.mark.slow
def test_memory_is_flat_over_ten_minutes(tmp_path: Path):
    samples: list[tuple[float, int]] = []

    def look(engine):
        if not samples or engine.seconds() - samples[-1][0] > 30.0:
            pages = int(Path("/proc/self/statm").read_text().split()[1])
            samples.append((engine.seconds(), pages * resource.getpagesize()))

    flown = fly(circling(10.0), RunRequest(out=tmp_path), observers=(look,))
    assert flown.summary["outcome"] == "succeeded"
    after_a_minute = next(size for t, size in samples if t > 60.0)
    assert samples[-1][0] > 560.0
    growth = samples[-1][1] - after_a_minute
    assert growth < 8e6, samples


CHILD = """
import sys
sys.path[:0] = {tests!r}
from pathlib import Path
from test_long_flight import circling
from kybflow.api.flight import RunRequest, fly
fly(circling(10.0), RunRequest(out=Path({out!r})),
    observers=(lambda engine: print(engine.seconds(), flush=True),))
"""


@pytest.mark.thorough
@pytest.mark.parametrize("draw", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_a_killed_run_is_readable_up_to_the_last_second(tmp_path: Path, draw: int):
    lines = random.Random(draw).randint(100, 400)
    script = CHILD.format(tests=[str(HERE), str(HERE.parent / "support")], out=str(tmp_path))
    child = subprocess.Popen(
        [sys.executable, "-c", script], stdout=subprocess.PIPE, text=True, bufsize=1
    )
    assert child.stdout is not None
    for _ in range(lines):
        flown = float(child.stdout.readline())
    child.send_signal(signal.SIGKILL)
    rest = child.stdout.read().split()
    child.stdout.close()
    child.wait()
    flown = float(rest[-2]) if len(rest) > 1 else flown
    assert flown > 5.0
    recorded = read_recording(tmp_path / "log.mcap")
    last = [recorded[f"/v{i}/tick"].times[-1] / NS for i in range(4)]
    assert min(last) > flown - 1.0, (flown, last)
