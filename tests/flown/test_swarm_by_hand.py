"""missions/swarm_teleoperation.yaml on four emulated PX4, steered live: by a gamepad (SDL's virtual
one) and by the simulated haptic device, which lets the hand feel how the swarm's velocity differs
from the one that is asked."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from toolchain import MISSIONS, compiled, succeeds

from kybflow.core.signals import NS, Event
from kybflow.inputs.rows import InputRow, parse
from kybflow.recording.earlier_run import read_earlier_run
from kybflow.runtime.engine import Engine

OPERATOR = (MISSIONS / "operators" / "swarm_teleoperation.csv").read_text(encoding="utf-8")
PHASES = {
    "team": {
        "as_four": [24.0, 150.0],
        "as_three": [34.0],
        "wide": [72.0],
        "narrow": [81.0],
        "again": [146.0],
        "landing": [160.0],
    },
    "solo": {"leave": [34.0], "maintain": [81.0], "climb": [105.0], "rejoin": [146.0]},
}
"""When each phase begins in the paper's figure 4, seconds."""
PUNCTUAL, APART = 0.5, 0.6


def swarm_flight(
    target: str, out: Path, *observers: Callable[[Engine], None]
) -> tuple[Any, list[Event]]:
    """The flight with a target, which has landed and kept apart, on the paper's timeline."""
    plan = compiled(MISSIONS / "swarm_teleoperation.yaml", target=target, warns=True)
    flight, told = succeeds(plan, out, *observers)
    summary = flight.summary
    assert {record["final"] for record in summary["vehicles"].values()} == {"ground"}
    [separation] = [e for e in summary["expectations"] if "separation" in e["text"]]
    assert separation["value"] >= APART
    assert off_timeline(told) <= PUNCTUAL
    return flight, told


def off_timeline(told: list[Event]) -> float:
    """How far the beginning of any phase is from the paper's, seconds."""
    begun: dict[tuple[str, str], list[float]] = {}
    for event in told:
        if event.name == "phase_started":
            flow, phase = str(event.fields["flow"]), str(event.fields["phase"])
            begun.setdefault((flow, phase), []).append(event.time / NS)
    pairs = (
        (due, began)
        for flow, phases in PHASES.items()
        for phase, times in phases.items()
        for due, began in zip(times, begun[flow, phase], strict=True)
    )
    return max(abs(due - began) for due, began in pairs)


class Operator:
    """A person at a gamepad who does what the recorded one did, by the run's clock. An observer."""

    BUTTONS = {  # noqa: RUF012  # SDL's numbers
        "formation": 0, "leave": 1, "widen": 2, "home": 3,
        "land": 6, "up": 11, "rejoin": 13, "together": 14,
    }  # fmt: skip
    LEFT_X, LEFT_Y, RIGHT_X, RIGHT_Y, DEAD_MAN = 0, 1, 2, 3, 10

    def __init__(self) -> None:
        self._rows: Iterator[InputRow] = iter(parse(OPERATOR).rows)
        self._next = next(self._rows, None)
        self._pad: Any = None

    def __call__(self, engine: Engine) -> None:
        if self._pad is None:
            from virtual_pad import VirtualPad

            self._pad = VirtualPad()
            self._pad.press(self.DEAD_MAN)
        while self._next is not None and self._next.time <= engine.clock.now:
            self._does(self._next)
            self._next = next(self._rows, None)

    def _does(self, row: InputRow) -> None:
        axes = row.axes
        self._pad.move(self.RIGHT_Y, -axes["x"])
        self._pad.move(self.RIGHT_X, -axes["y"])
        self._pad.move(self.LEFT_Y, -axes["z"])
        self._pad.move(self.LEFT_X, -axes["turn"])
        for name, number in self.BUTTONS.items():
            self._pad.press(number, down=name in row.held)


@pytest.mark.slow
def test_four_px4_by_a_gamepad(tmp_path: Path) -> None:
    pytest.importorskip("pygame")
    _, told = swarm_flight("hands", tmp_path / "run", Operator())
    assert not [event for event in told if event.name == "input_lost"]


@pytest.mark.slow
def test_four_px4_by_a_haptic_device_that_lets_the_hand_feel_the_swarm(tmp_path: Path) -> None:
    flight, _ = swarm_flight("haptic", tmp_path / "run")
    rows = parse(read_earlier_run(flight.folder).inputs["stick"]).rows
    told = {row.time / NS: row.axes for row in rows if not row.lost}

    def during(axis: str, since: float, until: float) -> list[float]:
        return [axes[axis] for time, axes in told.items() if since < time < until]

    sluggish, following = during("force_x", 29.05, 29.3), during("force_x", 30.4, 31.0)
    assert max(during("x", 30.4, 31.0)) < -0.2
    # the spring alone, once the swarm is as fast as asked
    assert max(sluggish) > 1.5 * max(following)
    assert min(during("force_x", 31.05, 31.25)) < -0.05  # it goes on where the hand has let go
    assert max(map(abs, during("force_x", 40.0, 42.0))) < 0.05
