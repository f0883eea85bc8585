"""Verdicts beside the truth: what `summary.json` and the report say, and what the recording shows.

    python bench/verdicts.py [--first 1000] [--runs 300] [--show]

Each run is drawn from a number (`bench/studies/verdict_cases.py`). A script that uses no module of
kybflow (`bench/studies/recorded_truth.py`) recomputes from `log.mcap` and `events.jsonl` the ends
of the vehicles, their errors, stays and estimators, the expectations, faults, commands, collisions
and the fence. Of broken recordings, copies that end anywhere or lack a chunk, the report must show
what can still be read. Printed is each difference, and the runs and facts of each kind.
"""

from __future__ import annotations

import argparse
import collections
import json
import re
import shutil
import struct
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "tests" / "support"))

from studies.recorded_truth import Truth, Vehicle, read  # noqa: E402
from studies.verdict_cases import Case, draw  # noqa: E402

from kybflow.api.flight import RunRequest, fly  # noqa: E402
from kybflow.report.data import read_run  # noqa: E402
from kybflow.report.estimator_pages import statistics  # noqa: E402
from kybflow.report.page import write_report  # noqa: E402
from kybflow.runtime.engine import Engine  # noqa: E402

NEAR = 2e-5
"""The largest difference of two figures, of their size: the summary has six digits."""
TOUCHING, APART = 0.08, 0.9
"""Distances of two vehicles' centres, m: nearer they touch, further apart they don't."""
STANDS = 0.05
BEYOND, BETWEEN_LOOKS = 0.1, 0.3
"""How far outside the fence counts, m, and how far one may get between two looks, m."""
CHUNK = 6


class Differences:
    """found: the differences of a run. facts: how many were compared."""

    def __init__(self) -> None:
        self.found: list[str] = []
        self.facts = 0

    def same(self, what: str, said: Any, true: Any) -> None:
        self.facts += 1
        if isinstance(said, float) and isinstance(true, float):
            good = abs(said - true) <= NEAR * max(abs(said), abs(true)) + 2e-7
        else:
            good = said == true
        if not good:
            self.found.append(f"{what}: said {said!r}, true {true!r}")

    def holds(self, what: str, good: bool) -> None:
        self.same(what, good, True)


def compare(folder: Path, case: Case, found: Differences) -> None:
    """Compare the summary and the report of a complete run with its recording."""
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    lines = (folder / "events.jsonl").read_text(encoding="utf-8").splitlines()
    events = [json.loads(line) for line in lines]
    if summary["recording"] is None:
        topics = read(folder / "log.mcap")
        found.holds("events.jsonl is /events", topics["/events"].values == events)
        truth = Truth(topics, events, summary)
        for name, vehicle in truth.vehicles.items():
            compare_vehicle(name, vehicle, truth, summary["vehicles"][name], found)
        compare_expectations(case, truth, summary, found)
        compare_impacts(case, truth, found)
        compare_tracks(folder, topics, truth.vehicles, found)
    compare_run(case, events, summary, found)
    compare_page(folder, summary, found)


def compare_vehicle(
    name: str, vehicle: Vehicle, truth: Truth, said: dict[str, Any], found: Differences
) -> None:
    visits = truth.visits[name]
    found.same(f"{name}: stays", len(said["behaviors"]), len(visits))
    for entry, visit in zip(said["behaviors"], visits, strict=False):
        where = f"{name}: {visit.name} at {visit.start:.3f} s"
        found.same(f"{where}: name", (entry["name"], entry["part"]), (visit.name, visit.part))
        found.same(f"{where}: start", entry["start_s"], visit.start)
        found.same(f"{where}: end", (entry["end_s"], entry["ended"]), (visit.end, visit.ended))
        during = vehicle.during(visit.start, visit.end)
        compare_errors(where, entry, vehicle.error[during], vehicle.velocity_error[during], found)
    begun = vehicle.time > truth.begun - 1e-6
    compare_errors(name, said, vehicle.error[begun], vehicle.velocity_error[begun], found)
    height = float(vehicle.position[-1, 2])
    others = [v.position[-1] for other, v in truth.vehicles.items() if other != name]
    lies_on = any(np.hypot(*(vehicle.position[-1] - o)[:2]) < APART for o in others)
    if not lies_on or height < STANDS:
        found.same(f"{name}: final", said["final"], "air" if height > STANDS else "ground")
    off = vehicle.position[begun & ~vehicle.flies & vehicle.armed, 2]
    found.holds(f"{name}: on the ground outside of `airborne_s`", lies_on or not (off > 0.3).any())
    if vehicle.battery is not None:
        found.same(f"{name}: min_battery", said["min_battery"], float(vehicle.battery.min()))
    used = [
        (event["fields"].get("estimator") or "", event["t_s"])
        for event in truth.events
        if event["vehicle"] == name and event["event"] in ("estimator_changed", "estimator_lost")
    ]
    found.same(
        f"{name}: estimators",
        [(use["name"], use["start_s"]) for use in said["estimators"]],
        [(one, float(f"{at:.6g}")) for one, at in used],
    )


def compare_errors(
    where: str, said: dict[str, Any], position: Any, velocity: Any, found: Differences
) -> None:
    for key, values in (("position_error_m", position), ("velocity_error_m_s", velocity)):
        known = values[~np.isnan(values)]
        if not len(known) or said[key] is None:
            found.same(f"{where}: {key}", said[key] is None, not len(known))
            continue
        true = (known.mean(), np.sqrt((known * known).mean()), known.max())
        for figure, value in zip(("mean", "rms", "max"), true, strict=True):
            found.same(f"{where}: {figure} of {key}", said[key][figure], float(value))


def compare_expectations(
    case: Case, truth: Truth, summary: dict[str, Any], found: Differences
) -> None:
    said = summary["expectations"]
    found.same("expectations", [line["text"] for line in said], [*case.expectations])
    for line in said:
        judged = truth.judge(line["text"])
        if judged.margin is None or abs(judged.margin) > 1e-9:
            found.same(f"{line['text']}: held", line["held"], judged.held)
        found.same(f"{line['text']}: value", line["value"], judged.value)
        if judged.margin is not None or line["margin"] is not None:
            found.holds(
                f"{line['text']}: margin {line['margin']}, {judged.margin}",
                None not in (judged.margin, line["margin"])
                and abs(judged.margin - line["margin"]) < 1e-5 * (1.0 + abs(judged.value or 0.0)),
            )


def compare_impacts(case: Case, truth: Truth, found: Differences) -> None:
    """Compare collisions, hard landings and flights outside the fence."""
    hits = truth.named("collided")
    names = [*truth.vehicles]
    if len(names) > 1:
        apart = truth.apart(*names)
        between = [event for event in hits if event["fields"]["into"] in names]
        if (apart < TOUCHING).any():
            found.holds(f"a collision at {apart.min():.3f} m", bool(between))
        if between:
            found.holds(f"no collision at {apart.min():.3f} m", bool(apart.min() < APART))
    for event in truth.named("landed_hard"):
        own = truth.vehicles[event["vehicle"]]
        last = own.speed[own.time <= event["t_s"] + 1e-6][-2:]
        found.holds(f"speed of landing {event['fields']}", any(
            abs(speed - event["fields"]["speed"]) < 1e-9 for speed in last
        ))  # fmt: skip
    for name, own in truth.vehicles.items():
        sinks = own.flies & own.armed & (own.velocity[:, 2] < -1.7) & (own.position[:, 2] < 0.03)
        if sinks.any():
            told = [
                event for event in (*hits, *truth.named("landed_hard")) if event["vehicle"] == name
            ]
            found.holds(f"{name} hit the floor", bool(told))
        fence = case.plan.fence
        assert fence is not None
        out = [beyond for _, beyond in truth.beyond(name, (fence.low, fence.high))]
        told = [event for event in truth.named("fence_left") if event["vehicle"] == name]
        if max(out, default=0.0) > BEYOND + BETWEEN_LOOKS:
            found.holds(f"{name} left the fence by {max(out):.2f} m", bool(told))
        for event in told:
            found.holds(f"{name}: never {event['fields']}", max(out, default=0.0) > BEYOND)


def compare_run(
    case: Case, events: list[dict[str, Any]], summary: dict[str, Any], found: Differences
) -> None:
    """Compare the outcome, the faults and the commands with the events."""

    def named(name: str) -> list[dict[str, Any]]:
        return [event for event in events if event["event"] == name]

    injected = {event["at"].rpartition(":")[2] for event in named("fault_injected")}
    never = {entry["at"].rpartition(":")[2] for entry in summary["never_injected"]}
    written = {str(fault.at).rpartition(":")[2] for fault in case.plan.faults}
    found.same("faults", (injected | never, injected & never), (written, set()))
    given = [
        (float(f"{event['t_s']:.6g}"), event["fields"]["command"], event["fields"]["by"])
        for event in named("command_given")
        if event["fields"]["accepted"] and event["fields"]["by"] != "schedule"
    ]
    told = [(one["t_s"], one["command"], one["by"]) for one in summary["commands"]]
    found.same("commands", told, given)
    over = named("run_ended")[-1]
    found.same("end", summary["sim_time_s"], float(f"{over['t_s']:.6g}"))
    bad = [e["event"] for e in events if e["event"] in ("collided", "landed_hard", "fence_left")]
    bad += [line["text"] for line in summary["expectations"] if not line["held"]]
    bad += [str(over["fields"]["reason"])] if over["fields"]["reason"] else []
    bad += [summary["recording"]] if summary["recording"] else []
    expected = {
        name for name in summary["vehicles"]
        if any(text in line for line in case.expectations
               for text in (f"finally {name} in fault", f"eventually {name} in fault"))
    }  # fmt: skip
    for name, vehicle in summary["vehicles"].items():
        last = vehicle["behaviors"][-1]["name"] if vehicle["behaviors"] else ""
        bad += ["fault"] if last == "fault" and name not in expected else []
        bad += [vehicle["final"]] if vehicle["final"] != "ground" else []
    unhandled = re.search(r"`\w+` failed: |another program commanded", summary["reason"] or "")
    good = summary["outcome"] == "succeeded"
    found.holds(f"{summary['outcome']}, but {bad}", good == (not bad and unhandled is None))
    if case.kind == "recording lost":
        found.holds("the lost recording is told", summary["recording"] is not None)


def compare_page(folder: Path, summary: dict[str, Any], found: Differences) -> None:
    page = (folder / "report.html").read_text(encoding="utf-8")
    held = sum(line["held"] for line in summary["expectations"])
    count = f"Expectations: {held} of {len(summary['expectations'])} held"
    found.holds(f"the report's {count}", count in page)
    badge = re.search(r'<span class="badge \w+">. ([\w ]+)</span>', page)
    outcome = summary["outcome"].replace("_", " ")
    found.same("the report's outcome", badge and badge[1], outcome)


def compare_tracks(
    folder: Path, topics: dict[str, Any], vehicles: dict[str, Vehicle], found: Differences
) -> None:
    """Compare what the report draws with the recording."""
    run = read_run(folder)
    for track in run.tracks:
        own = vehicles.get(track.name)
        found.same(f"{track.name}: ticks in the report", bool(len(track.time)), own is not None)
        if own is None or not len(track.time):
            continue
        index = np.searchsorted(own.time, track.time - 1e-6).clip(0, len(own.time) - 1)
        found.holds(f"{track.name}: times", np.abs(own.time[index] - track.time).max() < 1e-6)
        found.holds(f"{track.name}: end", own.time[-1] - track.time[-1] < 0.2)
        step = np.diff(own.time).max(initial=0.0)
        found.holds(f"{track.name}: gaps", np.diff(track.time).max(initial=0.0) < step + 0.2)
        found.holds(
            f"{track.name}: positions", np.abs(own.position[index] - track.position).max() < 1e-9
        )
        both = np.isnan(own.error[index]) == np.isnan(track.position_error)
        off = np.abs(own.error[index] - track.position_error)
        found.holds(f"{track.name}: errors", bool(both.all() and not (off > 1e-6).any()))
    for track, said in statistics(run):
        if track.name and track.vehicle in vehicles:
            own, rows = vehicles[track.vehicle], topics[f"/{track.vehicle}/estimator/{track.name}"]
            at, index = np.intersect1d(rows.times, own.time, return_indices=True)[0:2]
            values = rows.values[index]
            true = own.position[np.searchsorted(own.time, at - 1e-6)]
            used = values["used"] & values["present"]
            if not used.any():
                continue
            off = np.sqrt(((values["position"] - true) ** 2).sum(axis=1))[used]
            where = f"{track.vehicle}: {track.name}"
            found.same(f"{where}: largest error", said.highest, float(off.max()))
            found.same(f"{where}: mean error", said.mean, float(off.mean()))
            found.same(f"{where}: oldest", said.age_highest, float(values["age"][used].max()))


def compare_broken(folder: Path, case: Case, found: Differences) -> None:
    """Break a copy of the recording of a run that was killed; compare what the report shows."""
    copy = folder.with_name("broken")
    shutil.copytree(folder, copy)
    for name in ("summary.json", "report.html"):
        (copy / name).unlink()
    log = copy / "log.mcap"
    whole = log.read_bytes()
    if case.kind == "truncated":
        log.write_bytes(whole[: round(len(whole) * (0.02 + 0.98 * case.damage))])
    else:
        chunks = [*chunks_of(whole)]
        start, end = chunks[int(case.damage * len(chunks))]
        log.write_bytes(whole[:start] + whole[end:])
    topics = read(log)
    names = [vehicle.name for vehicle in case.plan.vehicles]
    vehicles = {
        name: Vehicle(name, topics, [[0.0, None]]) for name in names if f"/{name}/tick" in topics
    }
    compare_tracks(copy, topics, vehicles, found)
    page = write_report(copy).read_text(encoding="utf-8")
    found.holds("the report says that the run did not finish", "not finished" in page)
    shutil.rmtree(copy)


def chunks_of(data: bytes) -> Iterator[tuple[int, int]]:
    """The places of the chunks in an MCAP file."""
    at = 8
    while at + 9 <= len(data):
        opcode, length = struct.unpack_from("<BQ", data, at)
        if opcode == CHUNK:
            yield at, at + 9 + length
        at += 9 + length


def study(case: Case, folder: Path) -> Differences:
    """Fly a case and compare what is said of it."""

    def loses(engine: Engine) -> None:
        log = folder / "log.mcap"
        if engine.seconds() > 1.0 + 8.0 * case.damage and log.exists():
            log.unlink()

    watching = (loses,) if case.kind == "recording lost" else ()
    fly(case.plan, RunRequest(case.seed, folder, again=case.commands), (), watching)
    found = Differences()
    if case.kind != "recording lost":
        write_report(folder)
        compare(folder, case, found)
    else:
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        lines = (folder / "events.jsonl").read_text(encoding="utf-8").splitlines()
        compare_run(case, [json.loads(line) for line in lines], summary, found)
    if case.kind in ("truncated", "chunk missing"):
        compare_broken(folder, case, found)
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--first", type=int, default=1000)
    parser.add_argument("--runs", type=int, default=300)
    parser.add_argument("--show", action="store_true", help="the mission of each difference")
    asked = parser.parse_args()
    kinds: collections.Counter[str] = collections.Counter()
    ends: collections.Counter[str] = collections.Counter()
    facts = wrong = 0
    began = process_time()
    for seed in range(asked.first, asked.first + asked.runs):
        with tempfile.TemporaryDirectory() as above:
            case = draw(seed, Path(above))
            folder = Path(above) / "run"
            found = study(case, folder)
            summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        kinds[case.kind] += 1
        kinds[f"on {case.target}"] += 1
        ends[summary["outcome"]] += 1
        facts += found.facts
        wrong += bool(found.found)
        for line in found.found:
            print(f"{seed} ({case.kind}, {case.target}) {line}", flush=True)
        if found.found and asked.show:
            print(case.text, *case.commands, summary["reason"], sep="\n", flush=True)
    for counted in (kinds, ends):
        print(", ".join(f"{count} {what}" for what, count in sorted(counted.items())))
    took = process_time() - began
    print(f"{asked.runs} runs, {facts} facts, {wrong} runs differ, {took:.0f} s of one processor")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
