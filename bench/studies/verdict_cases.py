"""Flights whose verdicts are worth checking, drawn from a number: faults of the catalog, estimates
that are lost, people who stop and land, vehicles that fly into each other and out of the fence, and
recordings that break."""

from __future__ import annotations

import random
from pathlib import Path
from typing import NamedTuple

from kybflow.core.signals import NS
from kybflow.dsl.compiler import compile_mission
from kybflow.dsl.plan import Plan
from kybflow.parts.catalog import load_catalog
from kybflow.runtime.commanding.command_queue import RecordedCommand
from studies.random_faults import SCENARIOS, faults_of

TARGETS = {"sim": 14, "emulated_px4": 2, "emulated_ardupilot": 2, "emulated_ardrone": 2}
KINDS = {
    "faults": 24, "lost estimate": 12, "people": 18, "collision": 12, "outside": 12,
    "truncated": 10, "chunk missing": 6, "recording lost": 6,
}  # fmt: skip
"""The weights of the targets and of the kinds."""
LOSSES = (
    "inject: estimator_killed, estimator: mocap", "inject: mocap_dropout", "inject: mocap_frozen",
    "inject: mocap_jump, offset: [0.4, 0, 0]", "inject: mocap_noise, factor: 30",
    "inject: link_cut",
)  # fmt: skip
ORDERS = (
    "land", "land {v}", "pause", "pause {v}", "resume", "stop", "stop it smells", "switch {v} down",
    "switch {v} hold", "reset {v}", "land nobody", "release", "emit operator.go",
)  # fmt: skip
BOUNDS = {"position_error": 0.03, "velocity_error": 0.05, "state.altitude": 1.0, "state.speed": 0.5}
_TRIES = 60


class Case(NamedTuple):
    """A flight. damage: where the recording breaks, as a share of its length."""

    seed: int
    kind: str
    target: str
    plan: Plan
    text: str
    expectations: tuple[str, ...]
    commands: tuple[RecordedCommand, ...]
    damage: float


def draw(seed: int, folder: Path) -> Case:
    """Draw the flight `seed` and write its mission into `folder`."""
    for attempt in range(_TRIES):
        case = _drawn(seed, random.Random(f"verdicts {seed} {attempt}"), folder)
        if case is not None:
            return case
    raise RuntimeError(f"no valid flight in {_TRIES} attempts for the seed {seed}")


def _drawn(seed: int, rng: random.Random, folder: Path) -> Case | None:
    [kind] = rng.choices([*KINDS], [*KINDS.values()])
    [target] = rng.choices([*TARGETS], [*TARGETS.values()])
    names = ("a", "b") if kind == "collision" or rng.random() < 0.3 else ("a",)
    expectations = tuple(_expectation(rng, names) for _ in range(rng.randint(2, 6)))
    half = rng.choice((1.2, 2.5)) if kind == "outside" else 2.5
    lines = [
        "kybflow: 1", f"mission: verdict_{seed}", "import: {std: kybflow/airframes}",
        f"world: {{fence: {{from: [-{half}, -{half}, 0], to: [{half}, {half}, 2]}}}}",
        "time_limit: 40 s", "vehicles:",
    ]  # fmt: skip
    frame = "ardrone" if target == "emulated_ardrone" else rng.choice(("nano_plus", "mk_quadro"))
    for number, name in enumerate(names):
        lines += _vehicle(rng, kind, name, frame, -0.8 + 1.6 * number)
    lines += ["expect:", *(f"  - {text}" for text in expectations)]
    path = folder / f"verdict{seed}.yaml"
    faults: list[str] = []
    if kind in ("faults", "lost estimate", "outside") or rng.random() < 0.2:
        plan = _compiled(path, lines, target)
        if plan is None:
            return None
        if kind == "lost estimate":
            lasts = rng.choice(("", f", for: {rng.uniform(0.3, 4.0):.2f} s"))
            at = f"at: {rng.uniform(2.0, 12.0):.2f} s, on: a"
            faults = [f"{{{at}, {rng.choice(LOSSES)}{lasts}}}"]
        elif kind == "outside":
            push = f"[{rng.choice((-1, 1)) * rng.uniform(1.0, 6.0):.2f}, 0, 0]"
            at = f"at: {rng.uniform(4.0, 9.0):.2f} s, on: a"
            faults = [f"{{{at}, inject: push, acceleration: {push}, for: 2 s}}"]
        else:
            faults = [*faults_of(rng, plan, rng.choice(SCENARIOS))]
        lines += ["faults:", *(f"  - {line}" for line in faults)]
    plan = _compiled(path, lines, target)
    if plan is None:
        return None
    commands = []
    for _ in range(rng.randint(1, 4) if kind == "people" else 0):
        order = rng.choice(ORDERS).format(v=rng.choice(names))
        heard = round(rng.uniform(1.0, 14.0) * NS)
        commands.append(RecordedCommand(heard, order, rng.choice(("ann", "bob")), True))
    commands.sort(key=lambda command: command.heard)
    return Case(
        seed, kind, target, plan, "\n".join(lines), expectations, tuple(commands), rng.random()
    )


def _compiled(path: Path, lines: list[str], target: str) -> Plan | None:
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return compile_mission(path, catalog=load_catalog(), target=target).plan


def _vehicle(rng: random.Random, kind: str, name: str, frame: str, y: float) -> list[str]:
    height = round(rng.uniform(0.7, 1.4), 2)
    meets = kind == "collision" and rng.random() < 0.8
    x = 0.0 if meets else round(rng.uniform(-0.7, 0.7), 2)
    place = f"[{x}, {0.0 if meets else y}, {1.0 if meets else height}]"
    first = f"{{do: hover, for_time: {rng.uniform(1.0, 3.0):.1f} s, then: there}}"
    return [
        f"  {name}:", f"    like: std.{frame}", f"    start: {{at: [0, {y}, 0]}}",
        "    behaviors:",
        f"      up:    {{do: take_off, height: {height} m, then: hold}}",
        f"      hold:  {first}",
        f"      there: {{do: fly_to, position: {place}, then: down, failed: down}}",
        "      down:  {do: land}",
    ]  # fmt: skip


def _expectation(rng: random.Random, names: tuple[str, ...]) -> str:
    name, value = rng.choice(names), rng.choice([*BOUNDS])
    bound = f"{BOUNDS[value] * rng.uniform(0.1, 3.0):.3f} {'m/s' if 'speed' in value else 'm'}"
    if value == "velocity_error":
        bound = bound + "/s"
    of, sign = f"{name}.{value}", rng.choice("<<>")
    within = rng.choice(("", f" within {rng.uniform(2.0, 15.0):.2f} s"))
    state = rng.choice(("up", "hold", "there", "down", "landed", "fault", "auto_land"))
    places = ("", "", " in hold", " in there", " in down", " in up")
    forms = [
        f"{rng.choice(('max', 'min', 'mean', 'rms'))}({of}{rng.choice(places)}) {sign} {bound}",
        f"{rng.choice(('max', 'mean'))}({of}{rng.choice(places)}) < {bound}",
        f"always {of} {sign} {bound}",
        f"eventually {of} {sign} {bound}{within}",
        f"eventually {name} in {state}{within}",
        f"finally {name} in {rng.choice(('landed', 'fault', 'down'))}",
        f"finally {name}.state.altitude < {rng.uniform(1.0, 30.0):.1f} cm",
        f"finished within {rng.uniform(6.0, 30.0):.2f} s",
    ]
    if len(names) > 1:
        forms += [f"always separation(a and b) > {rng.uniform(0.1, 1.8):.2f} m"] * 2
    return rng.choice(forms)
