"""What `kybflow run` prints: a live table on a terminal, lines elsewhere, then the outcome."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator

from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from kybflow.api.flight import Flown
from kybflow.core.details import details, headline
from kybflow.core.geometry import distance
from kybflow.core.signals import NS, Event
from kybflow.core.units import format_measured
from kybflow.runtime.engine import Engine
from kybflow.runtime.vehicle.vehicle import Vehicle

_LAST_EVENTS = 6
_REDRAW = 0.1
_MARGIN = " " * 20
_QUIET_FIELDS = frozenset({"behavior", "part"})


def sentence(event: Event) -> str:
    """One event as a line, `  3.24 s  mk     behavior_started up (take_off)`, and below it the
    table that its fields carry. Why the run ended stands in the outcome that follows."""
    fields = dict(event.fields)
    words = [event.name]
    if "behavior" in fields:
        words.append(str(fields["behavior"]))
    if "part" in fields:
        words.append(f"({fields['part']})")
    quiet = _QUIET_FIELDS | {"reason"} if event.name == "run_ended" else _QUIET_FIELDS
    shown = {k: v for k, v in fields.items() if k not in quiet and v is not None}
    words += [f"{k}={headline(_short(v))}" for k, v in shown.items()]
    at = f"  [{event.at}]" if event.at else ""
    line = f"{event.time / NS:7.2f} s  {event.vehicle:8} {' '.join(words)}{at}"
    below = (row for value in shown.values() for row in details(_short(value)))
    return "\n".join([line, *(f"{_MARGIN}{row}" for row in below)])


def _short(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


class PlainPanel:
    """Prints each event as a line."""

    def __init__(self, console: Console) -> None:
        self._console = console

    def __enter__(self) -> PlainPanel:
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing is open."""

    def hear(self, event: Event) -> None:
        self._console.print(sentence(event), markup=False, highlight=False, soft_wrap=True)

    def look(self, engine: Engine) -> None:
        """A plain panel shows events only."""


class LivePanel:
    """A table that is redrawn in place, with the last events below it."""

    def __init__(self, console: Console) -> None:
        self._events: deque[str] = deque(maxlen=_LAST_EVENTS)
        self._live = Live(console=console, auto_refresh=False)
        self._drawn = 0.0
        self._began = time.monotonic()
        self._engine: Engine | None = None

    def __enter__(self) -> LivePanel:
        self._live.__enter__()
        return self

    def __exit__(self, *error: object) -> None:
        self._draw()
        self._live.__exit__(None, None, None)

    def hear(self, event: Event) -> None:
        self._events.append(sentence(event))

    def look(self, engine: Engine) -> None:
        """Redraw, at most ten times a second."""
        self._engine = engine
        if time.monotonic() - self._drawn >= _REDRAW:
            self._draw()

    def _draw(self) -> None:
        if self._engine is not None:
            self._drawn = time.monotonic()
            drawing = self._drawing(self._engine, self._drawn - self._began)
            self._live.update(drawing, refresh=True)

    def _drawing(self, engine: Engine, wall: float) -> Group:
        seconds = engine.seconds()
        table = Table(title=f"{engine.plan.mission}   {seconds:.1f} s   {seconds / wall:.1f} x")
        for heading in ("vehicle", "behavior", "estimator", "battery", "position error", "height"):
            table.add_column(
                heading, justify="left" if heading in ("vehicle", "behavior") else "right"
            )
        for vehicle in engine.vehicles:
            table.add_row(*_row(vehicle, engine.flying))
        return Group(
            table, *(Text(line, no_wrap=True, overflow="ellipsis") for line in self._events)
        )


def _row(vehicle: Vehicle, flying: bool) -> tuple[str, ...]:
    estimate, battery, setpoint = vehicle.estimate, vehicle.battery, vehicle.followed
    wanted = setpoint.position if setpoint is not None else None
    return (
        vehicle.name,
        vehicle.activity.machine.state if flying else "preflight",
        vehicle.estimator or "none",
        f"{battery.remaining:.0%}" if battery else "-",
        f"{distance(wanted, estimate.position) * 1000:.0f} mm" if wanted and estimate else "-",
        f"{estimate.position[2]:.2f} m" if estimate else "-",
    )


def outcome(flown: Flown, *, has_pace: bool) -> Iterator[str]:
    """The lines that follow a run. has_pace: whether its clock could run faster than real time."""
    summary = flown.summary
    for expectation in summary["expectations"]:
        mark = "held  " if expectation["held"] else "FAILED"
        yield f"{mark}  {expectation['text']}{_value(expectation)}"
    for seconds, name in flown.never_given:
        yield f"`{name}` at {seconds:g} s was never given: the run had ended"
    reason = f": {headline(summary['reason'])}" if summary["reason"] else ""
    yield f"{summary['mission']} {summary['outcome']}{reason}"
    pace = _pace(summary["real_time_factor"]) if has_pace else ""
    yield (
        f"{summary['sim_time_s']:.1f} s flown in {summary['wall_time_s']:.1f} s{pace}, "
        f"recorded in {flown.folder}"
    )


def _pace(factor: float | None) -> str:
    """How many times as fast as real time, a slow one with one significant digit."""
    if factor is None:
        return ""
    return f" ({factor:.0f} x real time)" if factor >= 1.0 else f" ({factor:.1g} x real time)"


def _value(expectation: dict[str, object]) -> str:
    value = expectation["value"]
    if not isinstance(value, float):
        return ""
    return f"  ({format_measured(value, str(expectation['unit']))})"
