"""Flights on a firmware's own simulator: calm, in wind, hung and killed; judged by its truth.

    python bench/firmware_flights.py px4|ardupilot 'COMMAND' [--times 3] [--only WORD]
                                     [--keep FOLDER]

COMMAND starts one vehicle of the simulator in the working folder, by `exec` in a shell, with `{i}`
for its number from 0 and `{system}` for its system id; docs/firmware.md shows both firmwares'. Use
a network namespace that only has the loopback, also to fly in several at once.

Two vehicles are set up once for each wind. Each flight starts them anew in copies of those folders,
and `kybflow run` as a process of its own, which is stopped for some seconds (SIGSTOP) or killed in
a phase: 0.3 m above the ground, 3 s into the mission's flight, or 1 s into its landing, and half a
second later in each further round. A second connection hears the truth. Each row shows:

exit: the exit code, and the outcome in the summary. down: the fastest true touch-down, m/s, of the
vehicles that kybflow landed by position, and in parentheses of those that landed in the autopilot's
own land mode or blindly. woke: the longest time from waking to the event that takes a vehicle back
or lands it, or says that it was never lost (`link_returned`), seconds; after a kill, the time until
the autopilot acts, with its mode. rest: seconds from then on until all vehicles stood disarmed.

An `!` marks a flight in which kybflow landed faster than 0.3 m/s, took longer than 1 s, or said
what is not true: `landed` in the air or of a vehicle that moves; that somebody else commands the
vehicle, or that its poses are in a wrong frame; a success although an autopilot left the setpoint
mode; a failure although nothing was done to the flight, apart from the mission's expectations,
which are for kybflow's own simulator, and from PX4's floor, which gives way; or an end before all
vehicles stand disarmed.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from time import monotonic, sleep
from typing import NamedTuple

ROOT = Path(__file__).parent.parent
sys.path[:0] = [str(ROOT / "tests" / "support"), str(ROOT / "tests" / "firmware")]

from toolchain import MISSIONS, compiled  # noqa: E402
from witness import Watched, Witness  # noqa: E402

from kybflow.cli.commands.mavlink.meeting import ticks  # noqa: E402
from kybflow.core.geometry import norm  # noqa: E402
from kybflow.core.signals import NS  # noqa: E402
from kybflow.drivers.mavlink.discovery import Discovery, ParameterSetup  # noqa: E402
from kybflow.drivers.mavlink.firmware import profile_of  # noqa: E402
from kybflow.drivers.mavlink.transport.sockets import open_wire  # noqa: E402
from kybflow.world.vehicle_context import VehicleContext  # noqa: E402

WIND = {
    "px4": {"SIH_WIND_N": 3.0, "SIH_WIND_E": 4.0},
    "ardupilot": {"SIM_WIND_SPD": 5.0, "SIM_WIND_DIR": 53.0, "SIM_WIND_T": 1.0},
}
"""Parameters that make a wind of 5 m/s."""
BOOT = {"px4": 5.0, "ardupilot": 17.0}
"""Seconds from the start of a simulator until it can be armed."""
OWN = 245
"""The system id of kybflow, for which the vehicles are set up."""
PHASES = {"take-off": ("up", 0.0), "flight": ("(eight|aside|hold)", 3.0), "landing": ("down", 1.0)}
"""The behavior that begins each phase, and seconds from there."""
LINE = re.compile(r" *[\d.]+ s  (\w+) +(.*)")
TAKES = "failsafe_started|control_returned|land_mode_started"
UNTRUE = "foreign_command|control_taken|mocap_frame_wrong|mocap_frame_unchecked"
LEFT, SUNK = re.compile(r"`\w+` flew [\d.]+ m outside the fence; "), -0.08
"""PX4's floor lets a vehicle sink while its thrust exceeds its weight; metres."""
EXPECTED = re.compile(r"\d+ of \d+ expectations did not hold")
FASTEST, SLOWEST, LONGEST = 0.3, 1.0, 90.0
"""The allowed speed of a touch-down, m/s; seconds from waking to an act; and of a flight."""


class Case(NamedTuple):
    """A flight. hang: the seconds for which kybflow is stopped, infinite if it is killed."""

    mission: str
    phase: str = ""
    hang: float = 0.0
    wind: bool = False

    def __str__(self) -> str:
        done = "kill -9" if self.hang == inf else f"{self.hang:g} s" if self.hang else "calm"
        return f"{self.mission} {'wind' if self.wind else done} {self.phase}".rstrip()


CASES = [
    *(Case(m, wind=w) for w in (False, True) for m in ("first_flight", "figure_eight", "sidestep")),
    *(Case("figure_eight", phase, hang) for phase in PHASES for hang in (1.0, 2.0, 4.0, inf)),
]


class Sample(NamedTuple):
    """The truth. time: seconds. height: above the start, metres."""

    time: float
    height: float
    climb: float
    speed: float


@dataclass
class Body:
    """One vehicle, looked at from outside. start: the height of its start. modes: each mode with
    its time. lines: what was said of the vehicle, with the time of its arrival."""

    watched: Watched
    start: float
    samples: list[Sample] = field(default_factory=list)
    modes: list[tuple[float, str]] = field(default_factory=list)
    lines: list[tuple[float, str]] = field(default_factory=list)

    def look(self, now: float) -> None:
        truth = self.watched.truth and self.watched.truth.truth(self.watched.now)
        if truth:
            height = truth.position[2] - self.start
            self.samples.append(Sample(now, height, truth.velocity[2], norm(truth.velocity)))
        mode = str(self.watched.profile.names.get(self.watched.heard.mode or 0))
        if not self.modes or self.modes[-1][1] != mode:
            self.modes.append((now, mode))

    @property
    def rests(self) -> bool:
        low = bool(self.samples) and self.samples[-1].height < 0.2
        return low and self.watched.heard.armed is False

    @property
    def down(self) -> float:
        """The speed of the touch-down, m/s: the fastest descent within the last second of it and 3
        cm above its end. PX4's floor may give way, so that its height is not known."""
        falls = [s for s in self.samples if s.climb < -0.1 and s.height < 0.3]
        time, height = falls[-1][:2] if falls else (0.0, 0.0)
        near = (s for s in falls if s.time > time - 1.0 and s.height < height + 0.03)
        return max((-s.climb for s in near), default=0.0)

    def said(self, pattern: str, since: float = 0.0) -> tuple[float, str] | None:
        return next((x for x in self.lines if x[0] >= since and re.match(pattern, x[1])), None)

    def left(self) -> tuple[float, str] | None:
        """Return when it left the setpoint mode before it landed, and for which mode."""
        offboard = self.watched.profile.names[self.watched.profile.modes["offboard"]]
        flew = next((time for time, mode in self.modes if mode == offboard), inf)
        end, _ = self.said("landed$") or (inf, "")
        return next((x for x in self.modes if flew < x[0] < end and x[1] != offboard), None)

    def untruths(self, code: int | None) -> Iterator[str]:
        """Yield what was said of it that is not true. code: the exit code."""
        if landed := self.said("landed$"):
            at = next((s for s in self.samples if s.time >= landed[0]), self.samples[-1])
            if at.height > 0.2 or at.speed > 0.3:
                yield f"landed at {at.height:.2f} m, {at.speed:.2f} m/s"
        if untrue := self.said(UNTRUE):
            yield untrue[1].split("  [")[0]
        if code == 0 and (left := self.left()):
            yield f"succeeded in {left[1]}"
        if not self.rests:
            yield "does not stand disarmed"


@dataclass
class Flight:
    """A flight while it goes on. begun, stopped, woken: when it began, and when kybflow was."""

    case: Case
    bodies: dict[str, Body]
    begun: float
    stopped: float = 0.0
    woken: float = 0.0
    code: int | None = None

    def disturb(self, process: subprocess.Popen[bytes], later: float) -> None:
        """Stop, wake or kill kybflow when it is due. later: seconds."""
        now, hang = monotonic(), self.case.hang
        if hang and not self.stopped and self._is_due(now - later):
            self.stopped = now
            process.send_signal(signal.SIGKILL if hang == inf else signal.SIGSTOP)
        elif self.stopped and not self.woken and now - self.stopped >= hang:
            process.send_signal(signal.SIGCONT)
            self.woken = monotonic()

    def _is_due(self, now: float) -> bool:
        behavior, seconds = PHASES[self.case.phase]
        began = [b.said(f"behavior_started {behavior} ") for b in self.bodies.values()]
        heights = [s.height for b in self.bodies.values() for s in b.samples[-1:]]
        if self.case.phase == "take-off" and max(heights, default=0.0) < 0.3:
            return False
        return all(x is not None and now - x[0] >= seconds for x in began)

    def judged(self, summary: dict[str, str]) -> tuple[list[str], str]:
        """Return what is beyond the figures, and the row."""
        wrong, since = list[str](), self.woken or self.stopped
        downs, others, acts = [0.0], [0.0], list[tuple[float, str]]()
        for body in self.bodies.values():
            wrong += body.untruths(self.code)
            left = body.left()
            is_own = not (left or body.said("behavior_started land_blind "))
            (downs if is_own else others).append(body.down)
            said = body.said(TAKES, since) or (None if left else body.said("link_returned", since))
            act = left if self.case.hang == inf else said
            if since:
                acts.append((act[0] - since, act[1].split()[0]) if act else (inf, "nothing"))
        slowest = max((act[0] for act in acts), default=0.0)
        if max(downs) > FASTEST:
            wrong.append("fast")
        if self.woken and slowest > SLOWEST:
            wrong.append("late")
        if self.code is None or (self.case.hang and not self.stopped):
            wrong.append("did not end" if self.stopped else "was never in its phase")
        reason = str(summary.get("reason") or "")
        samples = [s for body in self.bodies.values() for s in body.samples]
        if min((s.height for s in samples), default=0.0) < SUNK:
            reason = LEFT.sub("", reason)
        if not self.case.hang and reason and not EXPECTED.match(reason):
            wrong.append(reason)
        rest = max((s.time for s in samples), default=inf) - (since or self.begun)
        return wrong, (
            f"{'!' if wrong else ' '} {self.case!s:32s} exit {self.code} {summary.get('outcome')}"
            f"  down {max(downs):.2f} ({max(others):.2f})  woke {slowest:.2f}"
            f" {', '.join(sorted({act[1] for act in acts}))}  rest {rest:.1f}"
            f"  {'; '.join(dict.fromkeys(wrong))}"
        )


class Bench:
    """Starts simulators. command: starts one. folder: where they work."""

    def __init__(self, firmware: str, command: str, folder: Path) -> None:
        self._firmware, self._command, self._folder = firmware, command, folder
        self._ready: set[Path] = set()

    @contextmanager
    def running(self, folder: Path) -> Iterator[None]:
        processes = []
        for i in range(2):
            place = folder / str(i)
            place.mkdir(parents=True, exist_ok=True)
            words = ["sh", "-c", "exec " + self._command.format(i=i, system=i + 1)]
            with (place / "output.txt").open("w", encoding="utf-8") as output:
                processes.append(
                    subprocess.Popen(
                        words, cwd=place, stdin=subprocess.DEVNULL, stdout=output, stderr=output
                    )
                )
        try:
            sleep(BOOT[self._firmware])
            yield
        finally:
            for process in processes:
                process.terminate()
                with suppress(subprocess.TimeoutExpired):
                    process.wait(5.0)
                process.kill()
                process.wait()

    def prepared(self, wind: bool) -> Path:
        """Return a folder of two simulators that are set up for flight without GPS."""
        folder = self._folder / f"prepared_{'wind' if wind else 'calm'}"
        while folder not in self._ready:
            with self.running(folder):
                if sum(self._set_up(i, WIND[self._firmware] if wind else {}) for i in (1, 2)) == 0:
                    self._ready.add(folder)
        return folder

    def _set_up(self, system: int, air: dict[str, float]) -> int:
        """Write what is wrong; return how much, because some of it needs a restart."""
        profile, clock = profile_of(self._firmware), ticks()
        setup = ParameterSetup(profile, OWN, simulator=True)
        with closing(open_wire(profile.default_address(system))) as wire:
            discovery = Discovery(wire, system, OWN)
            discovery.find(clock)
            found = discovery.settle(system, profile, clock, (*setup.names, *air)).values
            wrong = setup.wrong(found) | {k: v for k, v in air.items() if found.get(k) != v}
            discovery.settle(system, profile, clock, wrong, wrong)
            discovery.watch(clock, NS)
        return len(wrong)

    def flown(self, case: Case, number: int, out: Path) -> Flight:
        """Fly a case in the folder `out`, until every vehicle stands disarmed."""
        for i in range(2):
            shutil.copytree(self.prepared(case.wind) / str(i), out / str(i), symlinks=True)
        mission = MISSIONS / f"{case.mission}.yaml"
        plan = compiled(mission, target=self._firmware, warns=True)
        command = [sys.executable, "-m", "kybflow", "run", str(mission), "--plain", "--no-report"]
        command += ["--target", self._firmware, "--out", str(out / "run")]
        with self.running(out), (out / "run.txt").open("w+", encoding="utf-8") as log:
            witness = Witness({i + 1: self._firmware for i in range(len(plan.vehicles))})
            flight = Flight(case, {}, monotonic())
            for i, v in enumerate(plan.vehicles, start=1):
                flight.bodies[v.name] = Body(witness.of[i], v.start[2])
                witness.of[i].behold(
                    VehicleContext(v.name, v.airframe, v.start, v.heading, None, 0.01)
                )
            process = subprocess.Popen(
                command, stdout=log.fileno(), stderr=log.fileno(),
                env=os.environ | {"PYTHONUNBUFFERED": "1"},
            )  # fmt: skip
            try:
                self._watch(flight, witness, process, out / "run.txt", 0.5 * number)
            finally:
                process.kill()
                process.wait()
                witness.close()
        return flight

    def _watch(
        self, flight: Flight, witness: Witness, process: subprocess.Popen[bytes], log: Path,
        later: float,
    ) -> None:  # fmt: skip
        clock, read, ended, bodies = ticks(), 0, inf, flight.bodies.values()
        while monotonic() - flight.begun < LONGEST:
            witness.look(next(clock))
            now = monotonic()
            lines = log.read_text(encoding="utf-8").split("\n")[:-1]
            for line in lines[read:]:
                if (found := LINE.match(line)) and found[1] in flight.bodies:
                    flight.bodies[found[1]].lines.append((now, found[2]))
            read = len(lines)
            for body in bodies:
                body.look(now)
            flight.disturb(process, later)
            flight.code = process.poll()
            ended = inf if flight.code is None else min(ended, now)
            if now - ended > 1.0 and all(body.rests for body in bodies):
                return


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("firmware", choices=WIND)
    parser.add_argument("command")
    parser.add_argument("--times", type=int, default=3)
    parser.add_argument("--only", default="", help="a regular expression")
    parser.add_argument("--keep", type=Path, help="keep the folders of the flights here")
    o = parser.parse_args()
    rows = broken = 0
    with tempfile.TemporaryDirectory() as temporary:
        folder = (o.keep or Path(temporary)).resolve()
        bench = Bench(o.firmware, o.command, folder)
        for number in range(o.times):
            for case in (c for c in CASES if re.search(o.only, str(c))):
                out = folder / f"{case} {number}".replace(" ", "_")  # PX4 refuses spaces
                flight = bench.flown(case, number, out)
                kept = {n: [b.modes, b.lines, b.samples] for n, b in flight.bodies.items()}
                kept["stopped"] = [[flight.stopped, flight.woken]]
                (out / "truth.json").write_text(json.dumps(kept), encoding="utf-8")
                path = out / "run" / "summary.json"
                text = path.read_text(encoding="utf-8") if path.exists() else "{}"
                wrong, row = flight.judged(json.loads(text))
                rows, broken = rows + 1, broken + bool(wrong)
                print(row, flush=True)
    print(f"\n{broken} of {rows} flights are beyond the figures")


if __name__ == "__main__":
    main()
