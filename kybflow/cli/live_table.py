"""The live view of a run: a table in a terminal, plain lines elsewhere."""

from __future__ import annotations

import time
from collections import deque

from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from kybflow.core.details import details, headline
from kybflow.core.geometry import distance
from kybflow.core.signals import NS, Event
from kybflow.runtime.engine import Engine
from kybflow.runtime.vehicle.vehicle import Vehicle

_SHOWN = 6
_REDRAW = 0.1
_MARGIN = " " * 20
_QUIET_FIELDS = frozenset({"behavior", "part"})


def sentence(event: Event) -> str:
    """One event as a line: `  3.24 s  mk     behavior_started up (take_off)`; the table that its
    words carry below it. Why the run ended is told by the summary that follows."""
    fields = dict(event.fields)
    words = [event.name]
    if "behavior" in fields:
        words.append(str(fields["behavior"]))
    if "part" in fields:
        words.append(f"({fields['part']})")
    quiet = _QUIET_FIELDS | {"reason"} if event.name == "run_ended" else _QUIET_FIELDS
    told = {k: v for k, v in fields.items() if k not in quiet and v is not None}
    words += [f"{k}={headline(_short(v))}" for k, v in told.items()]
    at = f"  [{event.at}]" if event.at else ""
    line = f"{event.time / NS:7.2f} s  {event.vehicle:8} {' '.join(words)}{at}"
    below = (row for value in told.values() for row in details(_short(value)))
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
        self._events: deque[str] = deque(maxlen=_SHOWN)
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
