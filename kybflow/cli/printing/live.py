"""The table of `kybflow run` on a terminal, redrawn in place."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator, Sequence
from math import ceil

from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from kybflow.cli.keys import KeyMessage, Offer, TerminalCommander
from kybflow.cli.output import grouped, styled
from kybflow.core.geometry import distance
from kybflow.core.signals import NS
from kybflow.core.units import DEG
from kybflow.runtime.engine import Engine
from kybflow.runtime.fleet.tracked_bodies import UNSEEN_NS
from kybflow.runtime.vehicle.vehicle import Vehicle
from kybflow.world.objects import SlideJoint, TurnJoint, WorldObject

_LAST_EVENTS = 6
_REDRAW_PERIOD_S = 0.1
_HELD = {"pause": "paused", "brake": "braked", "pilot": "by pilot"}
_FRAME, _LEAST_EVENTS = 6, 1
"""Lines of the table in addition to those of the vehicles, and the fewest events shown below the
keys."""
_POSITION = "position (m)"
_LEFT, _WHOLE = ("vehicle", "behavior"), (_POSITION, "nearest")
_MINUTES_FROM_S = 120.0
"""The time left from which it is shown in minutes."""
_GAP, _LABEL = 3, 10
"""Letters between two keys, and in the column of group names."""
_STYLES = {"asked": "bold yellow", "accepted": "green", "refused": "bold red"}


class LivePanel:
    """A table of the flight. Below it are the keys that the terminal's commander offers, and the
    last events. rehearsed: how long the rehearsal took, s; None without a rehearsal."""

    def __init__(
        self,
        console: Console,
        commander: TerminalCommander | None = None,
        rehearsed: float | None = None,
    ) -> None:
        self._console, self.commander, self._rehearsed = console, commander, rehearsed
        self._events: deque[str] = deque()
        self._live = Live(console=console, auto_refresh=False)
        self._drawn = 0.0
        self._began = time.monotonic()
        self._engine: Engine | None = None
        self._is_over = False

    def __enter__(self) -> LivePanel:
        self._live.__enter__()
        return self

    def __exit__(self, *error: object) -> None:
        self._is_over = True
        self._draw(refresh=False)
        self._live.__exit__(None, None, None)  # draws it

    def line(self, text: str) -> None:
        """Add the line of an event. All are kept until the vehicles fly, because a preflight may
        have many red lines."""
        self._events.append(text)
        while self._engine is not None and self._engine.flying and len(self._events) > _LAST_EVENTS:
            self._events.popleft()

    def on_tick(self, engine: Engine) -> None:
        """Handle pressed keys. Redraw after a key and ten times a second."""
        self._engine = engine
        pressed = self.commander is not None and self.commander.read_keys()
        if pressed or time.monotonic() - self._drawn >= _REDRAW_PERIOD_S:
            self._draw()

    def _draw(self, refresh: bool = True) -> None:
        if self._engine is not None:
            self._drawn = time.monotonic()
            drawing = self.drawing(self._engine, self._drawn - self._began)
            self._live.update(drawing, refresh=refresh)

    def drawing(self, engine: Engine, wall: float) -> Group:
        """Return the table, keys and events, `wall` seconds after the beginning."""
        seconds = engine.seconds()
        title = f"{engine.plan.mission}   {seconds:.1f} s   {seconds / wall:.1f} x"
        several = len(engine.vehicles) > 1
        left = self._time_left(engine, seconds / wall)
        table = Table(title=f"{title}{left}", pad_edge=not several)
        headings = ("vehicle", "behavior", "estimator", "battery", "error", _POSITION)
        for heading in (*headings, "nearest") if several else headings:
            is_left, is_whole = heading in _LEFT, heading in _WHOLE
            table.add_column(heading, justify="left" if is_left else "right", no_wrap=is_whole)
        for vehicle in engine.vehicles:
            table.add_row(*_row(vehicle, engine))
        below = [*_below(engine)] if engine.flying else []
        keys: Iterator[Text] = iter(())
        if (person := self.commander) is not None:
            person.update(engine.commander.situation(engine.clock.now, flying=engine.flying))
            if person.offers:
                width, height = self._console.size
                room = height - _FRAME - len(engine.vehicles) - len(below) - _LEAST_EVENTS
                keys = keys_drawn(person.offers, person.message, width, room)
        told, events = [*map(Text, below)], [*map(styled, self._events)]
        for line in (*told, *events) if engine.flying else ():
            line.no_wrap, line.overflow = True, "ellipsis"
        return Group(table, *told, *keys, *events)

    def _time_left(self, engine: Engine, pace: float) -> str:
        """Return for how long the run will last by the clock on the wall: about as long as the
        rehearsal did, or else at most until the time limit, when every vehicle lands."""
        if self._is_over or not engine.flying or pace <= 0.0:
            return ""
        flown = engine.mission_seconds()
        if self._rehearsed is not None and self._rehearsed > flown:
            return f"   about {_shown_time((self._rehearsed - flown) / pace)} left"
        left = engine.plan.time_limit - flown
        return f"   at most {_shown_time(left / pace)} to the time limit" if left > 0.0 else ""


def _shown_time(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < _MINUTES_FROM_S else f"{seconds / 60.0:.0f} min"


def _row(vehicle: Vehicle, engine: Engine) -> list[str]:
    """Return a vehicle's name, its state and what holds it, its measured values and, if there are
    several vehicles, the distance to the nearest one according to the estimates."""
    estimate, battery, setpoint = vehicle.estimate, vehicle.battery, vehicle.wanted
    wanted, hold = setpoint.position if setpoint is not None else None, vehicle.runner.hold
    held = () if hold is None else sorted(_HELD.get(holder, holder) for holder in hold.holders)
    cells = [
        vehicle.name,
        ", ".join((vehicle.state, *held)) if engine.flying else "preflight",
        vehicle.estimator or "none",
        f"{battery.remaining:.0%}" if battery else "-",
        f"{distance(wanted, estimate.position) * 1000:.0f} mm" if wanted and estimate else "-",
        " ".join(f"{x:z.2f}" for x in estimate.position) if estimate else "-",
    ]
    if len(engine.vehicles) > 1:
        others = [(v.estimate, v.name) for v in engine.vehicles if v is not vehicle]
        at = None if estimate is None else estimate.position
        gaps = [(distance(at, e.position), name) for e, name in others if at and e]
        gap, name = min(gaps, default=(0.0, ""))
        cells.append(f"{gap:.2f} m {name}" if name else "-")
    return cells


def _below(engine: Engine) -> Iterator[str]:
    """Yield a line with the keys of an input that reads the terminal, one with the phases of active
    flows, one with what vehicles wait for, and one for each object: its coordinates as motion
    capture sees them, and who touches it."""
    for own in engine.plan.inputs:
        if keys := own.part.cls.terminal_keys:
            named = [f"{button} {name}" for name, button in own.buttons.items()]
            yield f"{own.name[:10]:11}{', '.join((keys, *named))}, Ctrl-C lands"
    running = [engine.flows.running(flow.name) for flow in engine.plan.flows]
    active = [(one, (engine.clock.now - one.entered) / NS) for one in running if one.active]
    if phases := [f"{one.plan.name} {one.phase.name} {t:.0f} s" for one, t in active]:
        yield f"phases     {'   '.join(phases)}"
    free = [vehicle for vehicle in engine.vehicles if vehicle.runner.hold is None]
    waits = ((vehicle.runner.behavior.waits_for, vehicle.name) for vehicle in free)
    if reasons := grouped(wait for wait in waits if wait[0] is not None):
        whom = (f"{', '.join(names)} for {reason}" for reason, names in reasons.items())
        yield f"waiting    {'; '.join(whom)}"
    label = "objects"
    for name, one in engine.plan.objects.items():
        if one.moves:
            yield f"{label:11}{name} {_seen(one, engine)}{_touched(name, engine)}"
            label = ""


def _seen(one: WorldObject, engine: Engine) -> str:
    """Return an object's coordinates."""
    seen = engine.objects.seen.get(one.name)
    if seen is None or engine.clock.now - seen.time > UNSEEN_NS:
        return "not seen"
    match one.joint:
        case SlideJoint():
            return f"{seen.q:z.2f} m"
        case TurnJoint():
            return f"{seen.q / DEG:z.1f} deg"
    x, y, _ = seen.position
    return f"x {x:z.2f} m, y {y:z.2f} m, yaw {seen.q / DEG:z.1f} deg"


def _touched(name: str, engine: Engine) -> str:
    """Return the vehicles that touch an object by their own inference or by the simulator's truth,
    which knows the force."""
    touching = engine.inferred.touching
    forces = {who: 0.0 for who, touched in touching.items() if touched.object == name}
    for (who, of, _), force in engine.contacts.forces.items():
        if of == name:
            forces[who] = forces.get(who, 0.0) + force
    texts = [f"{who} {force:.2f} N" if force else who for who, force in sorted(forces.items())]
    return f", touched by {', '.join(texts)}" if texts else ""


def keys_drawn(
    offers: Sequence[Offer], message: KeyMessage, width: int, most: int
) -> Iterator[Text]:
    """Yield at most `most` lines of `width` letters: the offers by group, then the commander's
    message."""
    groups = grouped((offer.group, offer) for offer in offers)
    lines: list[Text] = []
    for name, members in groups.items():
        line = Text(f"{name[: _LABEL - 1]:{_LABEL}}", style="dim")
        for offer in members:
            key = (f" {offer.key or '-'} ", "bold not dim reverse")
            shown = Text.assemble(key, f" {offer.name}")
            if line.cell_len > _LABEL and line.cell_len + _GAP + shown.cell_len > width:
                lines.append(line)
                line = Text(" " * _LABEL)
            if line.cell_len > _LABEL:
                line.append(" " * _GAP)
            line.append_text(Text("", style="not dim").append_text(shown))
        lines.append(line)
    left = max(most - max(ceil(len(message.text) / width), 1), 2)
    if len(lines) > left:
        more = Text("more: see `kybflow command state`", style="dim")
        lines = [*lines[: left - 1], more]
    for line in lines:
        line.no_wrap, line.overflow = True, "ellipsis"
    yield from lines
    yield Text(message.text, style=_STYLES.get(message.kind, ""), overflow="fold")
