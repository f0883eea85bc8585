"""What `kybflow run` shows on a terminal while it flies: a table that is redrawn in place."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator, Sequence

from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from kybflow.cli.keys.terminal_commander import TerminalCommander
from kybflow.cli.printing import keys
from kybflow.cli.printing.run import sentence
from kybflow.core.geometry import distance
from kybflow.core.signals import NS, Event
from kybflow.runtime.engine import Engine
from kybflow.runtime.vehicle.vehicle import Vehicle

_LAST_EVENTS = 6
_REDRAW = 0.1
_HELD = {"pause": "paused", "brake": "braked", "pilot": "by pilot"}
_FRAME, _LEAST_EVENTS = 6, 1
"""Lines that the table has beside its vehicles, and events that stay in sight below the keys."""
_LEFT = ("vehicle", "behavior")


class LivePanel:
    """A table that is redrawn in place, with the keys of the terminal's commander and the last
    events below it."""

    def __init__(self, console: Console, commander: TerminalCommander | None = None) -> None:
        self._console, self._commander = console, commander
        self._events: deque[str] = deque(maxlen=_LAST_EVENTS)
        self._live = Live(console=console, auto_refresh=False)
        self._drawn = 0.0
        self._began = time.monotonic()
        self._engine: Engine | None = None

    def __enter__(self) -> LivePanel:
        self._live.__enter__()
        return self

    def __exit__(self, *error: object) -> None:
        self._draw(refresh=False)
        self._live.__exit__(None, None, None)  # which draws it

    def hear(self, event: Event) -> None:
        self._events.append(sentence(event))

    def look(self, engine: Engine) -> None:
        """Hear the keys; redraw, ten times a second and after a key."""
        self._engine = engine
        pressed = self._commander is not None and self._commander.hear()
        if pressed or time.monotonic() - self._drawn >= _REDRAW:
            self._draw()

    def _draw(self, refresh: bool = True) -> None:
        if self._engine is not None:
            self._drawn = time.monotonic()
            drawing = self._drawing(self._engine, self._drawn - self._began)
            self._live.update(drawing, refresh=refresh)

    def _drawing(self, engine: Engine, wall: float) -> Group:
        seconds = engine.seconds()
        table = Table(title=f"{engine.plan.mission}   {seconds:.1f} s   {seconds / wall:.1f} x")
        several = len(engine.vehicles) > 1
        headings = ("vehicle", "behavior", "estimator", "battery", "position error", "height")
        for heading in (*headings, "nearest") if several else headings:
            table.add_column(heading, justify="left" if heading in _LEFT else "right")
        for vehicle in engine.vehicles:
            nearest = (_nearest(vehicle, engine.vehicles),) if several else ()
            table.add_row(*_row(vehicle, engine.flying), *nearest)
        below = [*_phases(engine), *_waits(engine)]
        lines = (Text(line, no_wrap=True, overflow="ellipsis") for line in below)
        events = (Text(line, no_wrap=True, overflow="ellipsis") for line in self._events)
        return Group(table, *lines, *self._keys(engine, len(below)), *events)

    def _keys(self, engine: Engine, taken: int) -> Iterator[Text]:
        """Yield the lines about the keys, as many as the screen has room for. taken: lines between
        the table and them."""
        if self._commander is None:
            return
        self._commander.look(engine.commander.situation(engine.clock.now, flying=engine.flying))
        if offers := self._commander.offers:
            room = self._console.height - _FRAME - len(engine.vehicles) - taken - _LEAST_EVENTS
            yield from keys.drawn(offers, self._commander.saying, self._console.width, room)


def _row(vehicle: Vehicle, flying: bool) -> tuple[str, ...]:
    estimate, battery, setpoint = vehicle.estimate, vehicle.battery, vehicle.wanted
    wanted = setpoint.position if setpoint is not None else None
    return (
        vehicle.name,
        _doing(vehicle) if flying else "preflight",
        vehicle.estimator or "none",
        f"{battery.remaining:.0%}" if battery else "-",
        f"{distance(wanted, estimate.position) * 1000:.0f} mm" if wanted and estimate else "-",
        f"{estimate.position[2]:.2f} m" if estimate else "-",
    )


def _doing(vehicle: Vehicle) -> str:
    """The state that a vehicle is in, and what keeps it from going on."""
    hold = vehicle.activity.hold
    held = () if hold is None else sorted(_HELD.get(holder, holder) for holder in hold.holders)
    return ", ".join((vehicle.state, *held))


def _nearest(vehicle: Vehicle, vehicles: Sequence[Vehicle]) -> str:
    """How far the nearest other vehicle is, by the estimates, and which."""
    others = ((other.estimate, other.name) for other in vehicles if other is not vehicle)
    own = vehicle.estimate
    if own is None:
        return "-"
    gaps = ((distance(own.position, it.position), name) for it, name in others if it is not None)
    gap, name = min(gaps, default=(0.0, ""))
    return f"{gap:.2f} m {name}" if name else "-"


def _phases(engine: Engine) -> Iterator[str]:
    """The line about the flows that are in a phase."""
    if not engine.flying:
        return
    running = (engine.flows.running(flow.name) for flow in engine.plan.flows)
    phases = [
        f"{one.plan.name} {one.phase.name} {(engine.clock.now - one.entered) / NS:.0f} s"
        for one in running
        if one.active
    ]
    if phases:
        yield f"phases     {'   '.join(phases)}"


def _waits(engine: Engine) -> Iterator[str]:
    """The line about what vehicles wait for, each reason once."""
    reasons: dict[str, list[str]] = {}
    for vehicle in engine.vehicles if engine.flying else ():
        activity = vehicle.activity
        if activity.hold is None and activity.behavior.waits_for is not None:
            reasons.setdefault(activity.behavior.waits_for, []).append(vehicle.name)
    if reasons:
        whom = (f"{', '.join(names)} for {reason}" for reason, names in reasons.items())
        yield f"waiting    {'; '.join(whom)}"
