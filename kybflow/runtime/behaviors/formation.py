"""Fly in formation: each member keeps its distances to the others by what they publish.

The members of a group that run it meet first: each comes to rest and publishes where. When all are
there, each works out from the same news how the shape is laid and who takes which place
(`kybflow.flight.formation.places`), and all glide into their places in the same time. From there
each moves its own copy of the formation's frame, by a hand, along a path or behind a leader, and
lets it drift to those that its neighbours publish (`kybflow.flight.formation.frame`). No one
commands the others. A member that enters while others are in formation takes a free place, and goes
on along the path from the corner that they fly to; one that goes over to a behavior with the same
formation keeps its place.

The formation slows down for a member that lags behind its point, and stops for one that is `doubt`
away, has no estimate, or is silent for longer than `freshness`: `neighbour_lost` tells who and why.
A member that has left isn't waited for; like any other vehicle it is kept clear of.

The frame stops where any place would come closer than `margin` to the fence, `lowest` to the
ground, or `clearance`, from hubs, to obstacles and other vehicles. It fails when not all have come
after `patience`, and when the input or the leader stays lost for so long. World frame, metres.
"""

from __future__ import annotations

import zlib
from collections import deque
from collections.abc import Iterator, Mapping
from math import cos, pi, sin
from typing import ClassVar, Literal, NamedTuple

from kybflow.core.errors import Refused
from kybflow.core.geometry import ZERO, Vec3, add, distance, norm, scale, wrap
from kybflow.core.signals import NS, Done, Failed, Setpoint, SetpointKind, Tick, Time, Told
from kybflow.core.units import (
    Acceleration,
    Angle,
    AngularRate,
    Duration,
    Length,
    Path,
    Position,
    Speed,
)
from kybflow.flight.formation import places, shapes
from kybflow.flight.formation.frame import (
    Asked,
    FrameLimits,
    MovingFrame,
    Shift,
    distance_error,
    longest,
    mean_frame,
    mean_heading,
    moved,
)
from kybflow.flight.formation.taken_places import TakenPlaces, seen_from
from kybflow.flight.motion import Coast, Motion
from kybflow.flight.profiles import STEEPEST, smoothstep
from kybflow.parts import AIR, AXES, Behavior, Entry, Footprint, Objection, param, params
from kybflow.parts.behavior import SPEED_SHARE
from kybflow.runtime.behaviors._formation_drives import (
    AlongPath,
    BehindLeader,
    ByHand,
    Drive,
    Still,
)
from kybflow.runtime.behaviors._formation_room import FormationRoom, FormationRoomParams
from kybflow.runtime.behaviors._hand import was_held
from kybflow.runtime.behaviors._members import WAITING, InFormation, Member, Members, Team
from kybflow.world.vehicle_context import VehicleContext

_NOTICE: Time = NS // 10
"""How long a member has waited, beyond the delay, until all have surely heard of it."""
_UNHURRIED = 0.25
"""The share of `doubt` that a member may lag without slowing the others down."""
_IN_PLACE = 0.01
"""Metres from its place, one tick ahead, at which a point is there."""
_RETRACTED = 2.0
"""How many tolerances a formation may be off that was settled."""
_ROOM = "room: a place is at the fence, the ground or something in its way"
_STANDS, _PATIENT = 0.01, NS
"""The speed (m/s) up to which a frame that is to move stands, and how long until that is told."""


@params
class FormationParams(FormationRoomParams):
    members: str = param("The group that flies it.", names="group", read_only=True)
    shape: Literal["line", "square", "triangle", "tetrahedron"] = param(
        "Where its places lie.", default="line", read_only=True
    )
    side: Length = param(
        "Distance of places that are next to each other.", default=1.0, above=0.0, read_only=True
    )
    points: Path | None = param(
        "Its places, instead of a shape's: forward, to the left and up from its centre.",
        default=None, read_only=True,
    )  # fmt: skip
    center: Position | None = param(
        "Where its centre is at first; without it, amid the members.", default=None, read_only=True
    )
    turned: Angle | None = param(
        "How the shape is turned, counter-clockwise from the mean of the members' headings; without"
        " it, as its places are nearest.",
        default=None, read_only=True,
    )  # fmt: skip
    input: str | None = param(
        "The input that moves it.", default=None, names="input", read_only=True
    )
    path: Path | None = param(
        "The corners along which its centre moves, and done at the last.",
        default=None, read_only=True,
    )  # fmt: skip
    leader: str | None = param(
        "A vehicle, no member, that its centre moves and turns with.",
        default=None, names="vehicle", read_only=True,
    )  # fmt: skip
    offset: Position = param(
        "Its centre, seen from the leader: forward, to the left, up.",
        default=ZERO, read_only=True,
    )  # fmt: skip
    heading: Angle | None = param(
        "Heading that it turns to along its path; without it, it keeps its own.",
        default=None, read_only=True,
    )  # fmt: skip
    frame: Literal["heading", "world"] = param(
        "Where `x` and `y` of the input point: in the formation's heading, or east and north.",
        default="heading", read_only=True,
    )  # fmt: skip
    speed: Speed = param("Largest level speed.", default=0.5, above=0.0)
    climb: Speed = param("Largest vertical speed.", default=0.3, above=0.0)
    turn_rate: AngularRate = param("Largest rate of turning.", default=50 * pi / 180, above=0.0)
    acceleration: Acceleration = param("Largest acceleration.", default=0.7, above=0.0)
    tolerance: Length = param(
        "Mean error of a member's distances to its nearest eight up to which it is settled.",
        default=0.05, above=0.0,
    )  # fmt: skip
    delay: Duration = param(
        "Least age of what members hear, to simulate a radio.",
        default=0.0, at_least=0.0, below=0.4, read_only=True,
    )  # fmt: skip
    freshness: Duration = param(
        "Age of the news from which a member is silent.", default=0.3, above=0.0, at_most=5.0
    )
    doubt: Length = param(
        "Distance of a member from where it is to be for which the others stop.",
        default=0.5, above=0.0,
    )  # fmt: skip
    patience: Duration = param(
        "How long it waits for members that have not come, for a lost input and a lost leader.",
        default=5.0, at_least=0.0,
    )  # fmt: skip


class _Placed(NamedTuple):
    """A member in its place. began: when it set out for it. turn: the angle to its frame's heading
    that it then had."""

    place: int
    began: Time
    shift: Shift
    turn: float


class Formation(Behavior[FormationParams], flight=AIR >> AIR, emits=SetpointKind.POSITION):
    axes: ClassVar[tuple[str, ...]] = AXES
    hears = True
    tells: ClassVar[Mapping[str, tuple[str, ...]]] = {
        "formation_settled": ("error",),
        "neighbour_joined": ("neighbour",),
        "neighbour_left": ("neighbour",),
        "neighbour_lost": ("neighbour", "reason"),
        "neighbour_recovered": ("neighbour",),
    }

    def __init__(self, params: FormationParams, entry: Entry) -> None:
        super().__init__(params, entry)
        context = entry.context
        team = _team(params, context)
        self._shape = _shape(params, len(team))
        if len(self._shape) < len(team):
            raise Refused(f"it has {len(self._shape)} places for {len(team)} members")
        self._context, self._team = context, team
        self._members = Members(team, context.vehicle, _key(params))
        self._room = FormationRoom(context, team)
        self._drive = _drive(params, entry)
        self._untold: deque[tuple[str, dict[str, str | float | bool | None]]] = deque()
        self._last, self._is_new = entry.now, True
        self._frame, self._turned = MovingFrame(entry.position), 0.0
        self._moved = entry.now
        self._taken_for: tuple[float, int, frozenset[int]] | None = None
        self._wait(entry.motion, entry.heading, entry.now)

    def _wait(self, motion: Motion, heading: float, now: Time) -> None:
        """Come to rest, and wait for the others there."""
        self._coast, self._heading, self._entered = Coast.after(motion), heading, now
        self._since = now + round(self._coast.duration * NS)
        self._placed: _Placed | None = None
        self._settled = self._is_complete = False
        self._point: Vec3 | None = None

    def update(self, tick: Tick) -> Setpoint | Told | Done | Failed:
        p = self.params
        if was_held(self._last, tick):
            self._wait(_motion_of(tick), self._heading, tick.now)
        self._last = tick.now
        team = self._members.heard(tick, self._delay, p.freshness, p.doubt)
        for event, neighbour, reason in self._members.changes(team, whole=self._is_complete):
            why = {"reason": reason} if reason else {}
            self._untold.append((event, {"neighbour": neighbour, **why}))
        if self._is_new:
            self._is_new = False
            self._go_on(team, tick)
        ahead = None
        if isinstance(self._drive, BehindLeader):
            ahead = self._drive.hear(tick, p.delay, p.freshness)
        if self._placed is None:
            self._placed = self._met(team, ahead, tick)
        output = self._acting(team, tick)
        if isinstance(output, Setpoint) and self._untold:
            return Told(output, *self._untold.popleft())
        return output

    def _acting(self, team: Team, tick: Tick) -> Setpoint | Done | Failed:
        if self._placed is None:
            return self._waiting(team, tick)
        return self._flying(self._placed, team, tick)

    @classmethod
    def prepare(cls) -> None:
        places.prepare()

    @property
    def _delay(self) -> Time:
        return round(self.params.delay * NS)

    def _go_on(self, team: Team, tick: Tick) -> None:
        """Keep the place that the vehicle had in this formation until a moment ago."""
        before = self._members.own_news(tick)
        if before is None or before.said.place == WAITING:
            return
        self._frame, self._turned = before.frame, before.said.turned
        place, here = self._turned_shape()[before.said.place], self._coast.at(0.0)
        way = distance(place, self._frame.place(here).position)
        self._placed = self._set_out(before.said.place, way if way > _IN_PLACE else 0.0, tick)
        self._settled = before.said.settled
        self._catch_up([m for m in self._members.but_own(team) if not m.trouble], before.said.path)

    def _met(self, team: Team, ahead: MovingFrame | None, tick: Tick) -> _Placed | None:
        """Lay the formation, or join it; None while not all have come whom that needs."""
        members = [m for m in self._members.but_own(team) if not m.trouble]
        formed = [m for m in members if m.said.place != WAITING]
        waiting = [m for m in members if m.said.place == WAITING]
        all_there = len(waiting) == len(self._team) - 1
        if not (formed or all_there) or (self.params.leader is not None and ahead is None):
            return None
        since = max((self._since, *(m.said.since for m in waiting)))
        if tick.now < since + self._delay + _NOTICE:
            return None
        here = {m.name: m.said.point for m in waiting} | {self._context.vehicle: self._coast.end}
        here = {name: here[name] for name in self._team if name in here}
        if formed:
            return self._joined(formed, here, tick)
        heads = [self._heading, *(m.said.heading for m in waiting)]
        heading = mean_heading(sum(map(cos, heads)), sum(map(sin, heads)))
        return self._laid(
            here, ahead or MovingFrame(ZERO, heading=heading), ahead is not None, tick
        )

    def _laid(self, here: dict[str, Vec3], frame: MovingFrame, is_led: bool, tick: Tick) -> _Placed:
        """Take a place in a formation that all members lay together now."""
        p = self.params
        centre = frame.centre if is_led else p.center
        found = places.laid(tuple(here.values()), self._shape, frame.heading, centre, p.turned)
        self._turned = found.turned
        offsets = [frame.turned(place) for place in self._turned_shape()]
        centre = frame.centre if is_led else self._room.centred(found.centre, offsets, p)
        self._frame = frame._replace(centre=centre)
        goals = [add(centre, offsets[i]) for i in found.taken]
        way = longest(zip(here.values(), goals, strict=True))
        place = found.taken[list(here).index(self._context.vehicle)]
        return self._set_out(place, way, tick)

    def _joined(self, formed: list[Member], here: dict[str, Vec3], tick: Tick) -> _Placed | None:
        """Take one of the places that are free."""
        self._frame = mean_frame([m.frame for m in formed])
        self._turned = formed[0].said.turned
        self._catch_up(formed)
        taken = {m.said.place for m in formed}
        free = [i for i in range(len(self._shape)) if i not in taken]
        if len(free) < len(here):
            return None
        shape = self._turned_shape()
        goals = [add(self._frame.centre, self._frame.turned(shape[i])) for i in free]
        index = list(here).index(self._context.vehicle)
        column = places.assigned(tuple(here.values()), goals)[index]
        way = distance(self._coast.end, goals[column])
        return self._set_out(free[column], way, tick)

    def _catch_up(self, formed: list[Member], before: int = 0) -> None:
        """Go on along the path where the others are, who would be held back by one that began.
        before: the path that it moved along until now, which it begins anew."""
        drive = self._drive
        if isinstance(drive, AlongPath) and drive.key != before:
            corners = (m.said.corner for m in formed if m.said.path == drive.key)
            drive.corner = max(corners, default=drive.corner)

    def _set_out(self, place: int, way: float, tick: Tick) -> _Placed:
        p, elapsed = self.params, (tick.now - self._entered) / NS
        span = Shift.time_for(way, self._most_speed, p.acceleration)
        start = self._frame.place(self._coast.at(elapsed))
        shift = Shift(start, self._turned_shape()[place], span)
        return _Placed(place, tick.now, shift, wrap(self._heading - self._frame.heading))

    @property
    def _most_speed(self) -> float:
        return min(self.params.speed, SPEED_SHARE * self._context.airframe.speed)

    def _turned_shape(self) -> tuple[Vec3, ...]:
        """The places in the frame."""
        return tuple(places.turned_by(self._turned, place) for place in self._shape)

    def _taken_places(self, own: int, taken: frozenset[int]) -> TakenPlaces:
        """The places that are taken, worked out anew when others are."""
        which = (self._turned, own, taken)
        if self._taken_for != which:
            self._taken_for, self._taken = which, seen_from(self._turned_shape(), own, taken)
        return self._taken

    def _waiting(self, team: Team, tick: Tick) -> Setpoint | Failed:
        """Rest, and say so."""
        elapsed = (tick.now - self._entered) / NS
        self._say(tick, WAITING, self._coast.end, MovingFrame(ZERO, heading=self._heading))
        setpoint = self._coast.at(elapsed).setpoint(self._heading)
        come = team.members.keys() - team.troubled.keys()
        missing = [name for name in self._members.others if name not in come]
        if self.params.leader is not None and not missing:
            missing = [self.params.leader]
        who = " and ".join(f"`{name}`" for name in missing)
        self.waits_for = f"{who} to come" if who else None
        if elapsed > self.params.patience + self._coast.duration:
            verb = "have" if len(missing) > 1 else "has"
            what = f"{who} {verb} not come" if who else "no place has become free"
            reason = f"{what} within {self.params.patience:g} s"
            return Failed(setpoint, reason)
        return setpoint

    def _flying(self, own: _Placed, team: Team, tick: Tick) -> Setpoint | Done | Failed:
        """Keep the place while the frame moves."""
        p, drive, motion = self.params, self._drive, own.shift.at((tick.now - own.began) / NS)
        if self._members.goes_first(own.place, team):
            self._wait(self._frame.motion(motion), self._heading, tick.now)
            return self._waiting(team, tick)
        taken = self._taken_places(own.place, team.taken)
        limits = FrameLimits(self._most_speed, p.climb, p.turn_rate, p.acceleration)
        self._move(taken, team, limits, tick)
        wanted = self._frame.motion(motion)
        self._point = wanted.position
        self._turn_with(own, tick)
        self._let_feel(team, limits, tick)
        self._judge(own, taken, team, tick)
        self._say(tick, own.place, wanted.position, self._frame)
        setpoint = wanted.setpoint(self._heading, self._frame.rate)
        lost = " and ".join(f"`{name}`" for name in team.troubled if name in team.placed)
        self.waits_for = drive.waits_for or (f"{lost} to recover" if lost else None)
        if self.waits_for is None and tick.now > self._moved + _PATIENT:
            self.waits_for = _ROOM
        if drive.lost > p.patience:
            return Failed(setpoint, drive.trouble)
        return Done(setpoint) if drive.ended and self._is_complete else setpoint

    def _move(self, taken: TakenPlaces, team: Team, limits: FrameLimits, tick: Tick) -> None:
        """Move the frame by a tick: as slowly as the one that lags most needs it."""
        p, frame, share = self.params, self._frame, self._share(team, tick)
        asked = Asked()
        if p.path is None or self._is_complete:
            asked = self._drive.asked(tick, frame, limits)
            asked = Asked(scale(asked.velocity, share), share * asked.rate)
        obstacles = self._room.obstacles(tick, self._delay, team.away)
        fastest = 2.0 * max(limits.speed, limits.climb)
        near = self._room.near(frame, taken, obstacles, fastest, p)
        self._frame = moved(frame, asked, limits, tick.dt, team.frame, taken.reach, near)
        is_kept = bool(near) and norm(asked.velocity) > _STANDS >= norm(self._frame.velocity)
        if isinstance(self._drive, ByHand) or not is_kept:
            self._moved = tick.now

    def _share(self, team: Team, tick: Tick) -> float:
        """The share of the speed at which nobody is left behind."""
        p, lag = self.params, team.lag
        if self._members.is_stopping(team):
            return 0.0
        if self._point is not None:
            lag = max(lag, distance(tick.known().position, self._point))
        slow = _UNHURRIED * p.doubt
        return max(0.0, min(1.0, (p.doubt - lag) / (p.doubt - slow)))

    def _turn_with(self, own: _Placed, tick: Tick) -> None:
        """Turn as the frame does, and by what was between them at first."""
        span = max(own.shift.duration, STEEPEST * abs(own.turn) / self.params.turn_rate)
        done = (tick.now - own.began) / NS / span if span > 0.0 else 1.0
        left = own.turn * (1.0 - smoothstep(done)[1]) if done < 1.0 else 0.0
        self._heading = wrap(self._frame.heading + left)

    def _judge(self, own: _Placed, taken: TakenPlaces, team: Team, tick: Tick) -> None:
        """Find whether it is settled, and tell when all are."""
        p, seen = self.params, team.positions
        others = [(seen[place], wanted) for place, wanted in taken.near if place in seen]
        error = distance_error(tick.known().position, others)
        arrived = (tick.now - own.began) / NS >= own.shift.duration
        bound = p.tolerance * (_RETRACTED if self._settled else 1.0)
        self._settled = arrived and error <= bound
        complete = self._settled and self._members.is_settled(team)
        if complete and not self._is_complete:
            self._untold.append(("formation_settled", {"error": round(error, 4)}))
        self._is_complete = complete

    def _let_feel(self, team: Team, limits: FrameLimits, tick: Tick) -> None:
        """Let the hand feel how the swarm moves, and not as it asked."""
        if isinstance(self._drive, ByHand):
            formed = [m for m in self._members.but_own(team) if m.name in team.placed]
            known = [tick.known(), *(m.estimate for m in formed if m.estimate is not None)]
            velocity = shapes.centroid(tuple(one.velocity for one in known))
            self.push = self._drive.felt(velocity, self._frame, limits)

    def _say(self, tick: Tick, place: int, point: Vec3, frame: MovingFrame) -> None:
        drive = self._drive
        path, corner = (drive.key, drive.corner) if isinstance(drive, AlongPath) else (0, 0)
        self.says = InFormation(
            tick.now, self._members.key, self._since, place, self._settled, frame.heading,
            frame.rate, self._turned, point, frame.centre, frame.velocity, path, corner,
        )  # fmt: skip

    @classmethod
    def objections(cls, params: FormationParams, context: VehicleContext) -> Iterator[Objection]:
        team = context.groups.get(params.members, ())
        if context.vehicle not in team:
            return
        wrong = None if params.points else shapes.objection(params.shape, len(team))
        if wrong is not None:
            hint = "choose another shape, or write `points` of your own"
            yield Objection("shape", f"doesn't fit `{params.members}`: {wrong}", hint)
            return
        shape = _shape(params, len(team))
        if len(shape) < len(team):
            reason = f"has {len(shape)} places for the {len(team)} members of `{params.members}`"
            yield Objection("points", reason, "add places")
            return
        widest = max(context.diameters.get(name, 0.0) for name in team)
        apart = shapes.closest(shape)
        if apart <= widest:
            parameter = "points" if params.points else "side"
            reason = f"puts two places {apart:.3g} m apart, and a vehicle is {widest:.3g} m wide"
            yield Objection(parameter, reason, "leave more between them")
        if params.leader is not None and params.leader in team:
            yield Objection("leader", "is a member", "lead by a vehicle that is none")
        drives = [k for k in ("input", "path", "leader") if getattr(params, k) is not None]
        if len(drives) > 1:
            yield Objection(drives[1], f"can't move it beside `{drives[0]}`", "write one of them")

    @classmethod
    def footprint(cls, params: FormationParams, entry: Vec3 | None) -> Footprint | None:
        endless = params.path is None
        points: tuple[Vec3, ...] = () if entry is None else (entry,)
        if params.path is not None:
            points = (*points, *params.path)
        if params.center is not None:
            points = (*points, params.center)
        return Footprint(
            points, params.speed, None, is_endless=endless, acceleration=params.acceleration
        )


def _team(params: FormationParams, context: VehicleContext) -> tuple[str, ...]:
    return context.groups.get(params.members, (context.vehicle,))


def _shape(params: FormationParams, count: int) -> tuple[Vec3, ...]:
    return params.points or shapes.places_of(params.shape, params.side, count)


def _key(params: FormationParams) -> int:
    """A number that members have in common who speak of the same formation."""
    p = params
    what = (p.members, p.shape, p.side, p.points, p.center, p.turned)
    return zlib.crc32(repr(what).encode())


def _drive(params: FormationParams, entry: Entry) -> Drive:
    if params.input is not None:
        return ByHand(params.input, entry, in_world=params.frame == "world")
    if params.path:
        return AlongPath(params.path, params.heading)
    if params.leader is not None:
        return BehindLeader(params.leader, params.offset)
    return Still()


def _motion_of(tick: Tick) -> Motion:
    """Where the vehicle is to go on from."""
    followed = tick.setpoint
    if followed is not None and followed.position is not None:
        return Motion(followed.position, followed.velocity or ZERO)
    return Motion(tick.known().position, tick.known().velocity)
