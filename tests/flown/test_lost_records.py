"""What becomes of a run whose record is lost, or that is interrupted before or after it flies."""

from __future__ import annotations

import json
import signal
from collections.abc import Callable
from pathlib import Path

import pytest
from short_flights import named
from toolchain import MISSIONS, compiled, flight_of

from kybflow.api import flight
from kybflow.api.flight import Flown, RunRequest, fly
from kybflow.dsl.plan import Plan

FIRST = MISSIONS / "first_flight.yaml"


@pytest.fixture(scope="module")
def plan() -> Plan:
    return compiled(FIRST)


def shortened(path: Path) -> None:
    path.write_bytes(b"")


def moved(path: Path) -> None:
    path.parent.rename(path.parent.with_name("moved"))


@pytest.mark.parametrize(
    ("lose", "file"),
    [
        (Path.unlink, "log.mcap"),
        (shortened, "events.jsonl"),
        (moved, "log.mcap"),
        pytest.param(Path.unlink, "events.jsonl", marks=pytest.mark.thorough),
        pytest.param(shortened, "log.mcap", marks=pytest.mark.thorough),
        pytest.param(moved, "events.jsonl", marks=pytest.mark.thorough),
    ],
)
def test_a_run_whose_record_is_lost_in_flight_has_not_succeeded(
    plan: Plan, tmp_path: Path, file: str, lose: Callable[[Path], None]
) -> None:
    waiting = [tmp_path / "run" / file]

    def loses(engine: object) -> None:
        if engine.flying and engine.seconds() > 2.0 and waiting:  # type: ignore[attr-defined]
            lose(waiting.pop())

    flown, told = flight_of(plan, tmp_path / "run", loses)
    [stopped] = named(told, "recording_stopped")
    assert stopped.time / 1e9 == pytest.approx(2.5, abs=0.6)
    assert flown.summary["outcome"] == "failed"
    assert flown.summary["recording"] == flown.summary["reason"] == stopped.fields["reason"]
    assert [v["final"] for v in flown.summary["vehicles"].values()] == ["ground"]
    assert json.loads((tmp_path / "run/summary.json").read_text()) == flown.summary


def interrupted_while(
    name: str, plan: Plan, out: Path, monkeypatch: pytest.MonkeyPatch, times: int = 1
) -> Flown:
    """A run, with signals while `flight.NAME` is called."""
    called = getattr(flight, name)

    def call(*arguments: object, **named: object) -> object:
        for _ in range(times):
            signal.raise_signal(signal.SIGTERM)
        return called(*arguments, **named)

    monkeypatch.setattr(flight, name, call)
    return fly(plan, RunRequest(out=out))


def test_an_interrupt_while_drivers_are_opened_is_in_the_summary(
    plan: Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flown = interrupted_while("open_devices", plan, tmp_path, monkeypatch)
    assert (flown.exit_code, flown.summary["sim_time_s"]) == (130, 0.0)
    assert json.loads((tmp_path / "summary.json").read_text())["outcome"] == "interrupted"


@pytest.mark.thorough
def test_an_interrupt_after_the_flight_takes_nothing_away(
    plan: Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flown = interrupted_while("summarise", plan, tmp_path, monkeypatch)
    assert flown.exit_code == 0
    assert json.loads((tmp_path / "summary.json").read_text())["outcome"] == "succeeded"


def test_the_third_interrupt_ends_what_hangs(
    plan: Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("kybflow.runtime.interrupts.DEBOUNCE_S", 0.0)
    with pytest.raises(KeyboardInterrupt):
        interrupted_while("open_devices", plan, tmp_path, monkeypatch, times=3)
