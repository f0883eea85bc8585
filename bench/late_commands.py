"""Flights in which commands reach the vehicle late, and flights in which they don't.

    python bench/late_commands.py [--seeds 3] [--only WORD] [--false-alarms | --faults [--first 0]]

Each airframe hovers, flies an eight, or lands, when its commands become late. Printed for each
delay, by the simulator's truth, is the worst of the seeds:

told: how many flights had the alarm, and the longest time until then, seconds. bound: the delay at
which it is due, ms. down: the speed at the touch-down, m/s. side: how far it got from its start,
metres (the eight itself gets 0.75 m aside). `--false-alarms` flies the shipped missions in the lab
with `model_error: 20 %` and counts alarms; `--faults` flies random flights with faults in
simulation, as many as seeds that don't draw another target.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "tests" / "support"))

from studies.random_faults import draw  # noqa: E402
from toolchain import compiled, with_library  # noqa: E402
from wrong_frames import flown, missions  # noqa: E402

from kybflow.dsl.plan import Plan  # noqa: E402

ALARM = "commands_late"
FRAMES = ("nano_plus", "mk_quadro", "courier_quad", "x500")
STATES = {"hover": "hold", "eight": "eight", "landing": "down"}
DELAYS_MS = (20, 30, 60, 100, 150, 250)
MISSION = """\
kybflow: 1
mission: late_commands
summary: Take off, hover, fly an eight, land; meanwhile commands become late.
import:
  std: library/airframes.yaml
world:
  fence: {{from: [-2, -2, 0], to: [2, 2, 2.5]}}
vehicles:
  v:
    like: std.{frame}
    start: {{at: [0, 0, 0]}}
    behaviors:
      up: {{do: take_off, height: 1.2 m, then: hold}}
      hold: {{do: hover, for_time: {hover}, then: eight}}
      eight: {{do: figure_eight, width: 1.46 m, lap: 7 s, laps: 2, then: down}}
      down: {{do: land}}
faults:
  - {{when: behavior == {state} and elapsed > {after}, on: v, inject: clock_late, by: {late} ms}}
"""


def study(plan: Plan, seeds: int) -> str:
    """Return what the flights of a plan showed."""
    times, bounds, ends = [], set(), set()
    down = side = 0.0
    for seed in range(seeds):
        watch, told, summary = flown(plan, seed)
        begun = next((e.time for e in told if e.name == "fault_injected"), 0)
        for event in (e for e in told if e.name == ALARM):
            times.append((event.time - begun) / 1e9)
            bounds.add(round(float(event.fields["bound"]) * 1e3))
        down, side = max(down, watch.down), max(side, watch.side)
        ends.add(str(summary["outcome"]))
    bound = "/".join(str(b) for b in sorted(bounds)) or "-"
    return (
        f"told {len(times)}/{seeds} {max(times, default=0.0):5.1f} s  bound {bound:>5s} ms"
        f"  down {down:4.2f}  side {side:4.2f}  {'/'.join(sorted(ends))}"
    )


def late(seeds: int, only: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = with_library(Path(folder)) / "late_commands.yaml"
        for frame in FRAMES:
            for name, state in STATES.items():
                hover, after = ("12 s", "1 s") if name == "hover" else ("1 s", "0.5 s")
                for delay in DELAYS_MS:
                    what = f"{frame} {name} {delay} ms"
                    if only in what:
                        text = MISSION.format(
                            frame=frame, hover=hover, state=state, after=after, late=delay
                        )
                        plan = compiled(path, text, warns=True)
                        print(f"{what:28s} {study(plan, seeds)}", flush=True)


def false_alarms(seeds: int, only: str) -> None:
    flights = alarms = 0
    for name, plan in missions(only):
        for seed in range(seeds):
            _, told, summary = flown(plan, seed)
            flights, alarms = flights + 1, alarms + any(e.name == ALARM for e in told)
            for event in (e for e in told if e.name == ALARM):
                print(name, seed, event.vehicle, event.time / 1e9, event.fields, flush=True)
        print(f"{name}: {summary['outcome']}; {alarms} of {flights} flights", flush=True)


def with_faults(seeds: range) -> None:
    flights = 0
    for number in seeds:
        with tempfile.TemporaryDirectory() as folder:
            drawn = draw(number, with_library(Path(folder)))
            if drawn.target != "sim":
                continue
            _, told, summary = flown(drawn.plan, number)
        flights += 1
        for event in (e for e in told if e.name == ALARM):
            at = event.time / 1e9
            print(number, drawn.mission, event.vehicle, at, event.fields, drawn.faults, flush=True)
    print(f"{flights} flights, the last {summary['outcome']}")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--only", default="")
    parser.add_argument("--false-alarms", action="store_true")
    parser.add_argument("--faults", action="store_true")
    options = parser.parse_args()
    if options.faults:
        with_faults(range(options.first, options.first + options.seeds))
    elif options.false_alarms:
        false_alarms(options.seeds, options.only)
    else:
        late(options.seeds, options.only)


if __name__ == "__main__":
    main()
