"""Fly in formation: each member keeps its distances to the others, which publish their positions.

The members of the group that run this behavior meet first: each comes to rest and publishes its
position. When all are there, each computes from the same messages how the shape is laid out and who
takes which place (`kybflow.flight.formation.places`), and all glide to their places in the same
time. From then on each member moves its own copy of the formation's frame, by hand, along a path or
behind a leader, and lets it drift towards the copies that its neighbours publish
(`kybflow.flight.formation.frame`). No member commands the others. A member that enters while others
are in formation takes a free place by a path around the others (`kybflow.flight.formation.frame`),
and joins them on the way to their next corner. A member that changes to another state with the same
formation keeps its place.

The formation slows down for a member that lags behind its point, and stops for one that is `doubt`
away, has no estimate, or is silent for longer than `freshness`; `neighbour_lost` names the member
and the reason. A member that is ahead of the others, because they don't receive its messages, slows
down too. The formation doesn't wait for a member that has left, and keeps clear of it as of any
other vehicle.

The frame stops before any place comes closer than `margin` to the fence, `lowest` to the ground, or
`clearance`, measured from the hubs, to obstacles and other vehicles. The behavior fails if not all
members have come after `patience`, and if the input or the leader is lost for longer than that.
World frame, metres.
"""

from __future__ import annotations

import zlib
from collections import deque
from collections.abc import Iterator
from math import pi
from typing import ClassVar, Literal, NamedTuple

from kybflow.core.errors import Refused
from kybflow.core.events import BehaviorEvent, Emitting
from kybflow.core.geometry import ZERO, Vec3, distance, norm, scale, wrap
from kybflow.core.signals import NS, Done, Failed, Setpoint, SetpointKind, Tick, Time
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
from kybflow.flight.formation import places
from kybflow.flight.formation.frame import (
    Asked,
    FrameLimits,
    MovingFrame,
    WayToPlace,
    distance_error,
    moved,
)
from kybflow.flight.formation.places import TakenPlaces, seen_from
from kybflow.flight.motion import MAX_SLOPE, Motion, motion_of, smoothstep
from kybflow.parts import AIR, AXES, Behavior, Entry, Footprint, Objection, param, params
from kybflow.parts.behavior import SPEED_SHARE
from kybflow.runtime.behaviors._hand import was_held
from kybflow.runtime.behaviors.formation.drives import AlongPath, BehindLeader, ByHand, Drive
from kybflow.runtime.behaviors.formation.members import (
    NO_PLACE,
    Assigned,
    InFormation,
    Meeting,
    Members,
    NeighbourJoined,
    NeighbourLeft,
    NeighbourLost,
    NeighbourRecovered,
    Rest,
    Team,
)
from kybflow.runtime.behaviors.formation.room import (
    FormationRoom,
    FormationRoomParams,
    within_the_rotors,
)
from kybflow.world.vehicle_context import VehicleContext, hull_of

_LAG_SHARE = 0.25
"""The fraction of `doubt` by which a member may lag without slowing the others down."""
_IN_PLACE = 0.01
"""Distance (m) from its place, one tick ahead, at which a point counts as being there."""
_UNSETTLED_FACTOR = 2.0
"""Multiple of `tolerance` by which a settled member may be off before it is unsettled."""
_ROOM = "room: a place is at the fence, the ground or an obstacle"
_STANDING_SPEED, _STANDING_NS = 0.01, NS
"""The speed (m/s) up to which a frame that should move counts as standing, and the time after which
that is reported."""


@params
class FormationParams(FormationRoomParams):
    members: str = param("The group that flies the formation.", names="group", read_only=True)
    shape: Literal["line", "square", "triangle", "tetrahedron"] = param(
        "Shape of the formation.", default="line", read_only=True
    )
    side: Length = param(
        "Distance between neighbouring places.", default=1.0, above=0.0, read_only=True
    )
    points: Path | None = param(
        "Places instead of a shape: forward, to the left and up from the centre.",
        default=None, read_only=True,
    )  # fmt: skip
    center: Position | None = param(
        "Initial position of the centre; by default the mean position of the members.",
        default=None,
        read_only=True,
    )
    turned: Angle | None = param(
        "Rotation of the shape, counter-clockwise from the mean heading of the members; by "
        "default the one with the nearest places.",
        default=None, read_only=True,
    )  # fmt: skip
    input: str | None = param(
        "The input that moves the formation.", default=None, names="input", read_only=True
    )
    path: Path | None = param(
        "The corners of the centre's path; the behavior is done at the last one.",
        default=None, read_only=True,
    )  # fmt: skip
    leader: str | None = param(
        "A vehicle, not a member, with which the centre moves and turns.",
        default=None, names="vehicle", read_only=True,
    )  # fmt: skip
    offset: Position = param(
        "Position of the centre relative to the leader: forward, to the left, up.",
        default=ZERO, read_only=True,
    )  # fmt: skip
    heading: Angle | None = param(
        "Heading on the path; by default the formation keeps its own.",
        default=None, read_only=True,
    )  # fmt: skip
    frame: Literal["heading", "world"] = param(
        "Frame of the input's `x` and `y`: the formation's heading, or east and north.",
        default="heading", read_only=True,
    )  # fmt: skip
    speed: Speed = param("Largest horizontal speed.", default=0.5, above=0.0)
    climb: Speed = param("Largest vertical speed.", default=0.3, above=0.0)
    turn_rate: AngularRate = param("Largest rate of turning.", default=50 * pi / 180, above=0.0)
    acceleration: Acceleration = param("Largest acceleration.", default=0.7, above=0.0)
    tolerance: Length = param(
        "Largest mean error of a settled member's distances to its nearest eight.",
        default=0.05, above=0.0, room="across",
    )  # fmt: skip
    delay: Duration = param(
        "Smallest age of the members' messages, to simulate a radio.",
        default=0.0, at_least=0.0, below=0.4, read_only=True, limited_by="freshness",
    )  # fmt: skip
    freshness: Duration = param(
        "Age of the newest message above which a member counts as silent.",
        default=0.3,
        above=0.0,
        at_most=5.0,
    )
    doubt: Length = param(
        "Distance of a member from its place at which the others stop.",
        default=0.5, above=0.0, room="across",
    )  # fmt: skip
    patience: Duration = param(
        "Time to wait for missing members, a lost input or a lost leader.",
        default=5.0, at_least=0.0,
    )  # fmt: skip


class _Placed(NamedTuple):
    """A member that has a place. began: when it set out for the place. turn: the angle (rad) from
    the frame's heading to its own at that time."""

    place: int
    began: Time
    way: WayToPlace
    turn: float


class FormationSettled(BehaviorEvent):
    """All members have settled, for the first time since one came or was lost. `error` is the mean
    error of this member's distances to its neighbours."""

    error: Length


class Formation(Behavior[FormationParams], flight=AIR >> AIR, emits=SetpointKind.POSITION):
    axes: ClassVar[tuple[str, ...]] = AXES
    hears = True
    agreed = (
        "shape", "side", "points", "center", "turned", "input", "path", "leader", "offset",
        "heading", "frame",
    )  # fmt: skip
    own_events = (
        FormationSettled,
        NeighbourJoined,
        NeighbourLeft,
        NeighbourLost,
        NeighbourRecovered,
    )

    def __init__(self, params: FormationParams, entry: Entry) -> None:
        super().__init__(params, entry)
        context = entry.context
        team = context.groups.get(params.members, (context.vehicle,))
        self._shape = _shape(params, len(team))
        if len(self._shape) < len(team):
            raise Refused(f"it has {len(self._shape)} places for {len(team)} members")
        self._context, self._delay = context, round(params.delay * NS)
        p = params
        identity = (p.members, p.shape, p.side, p.points, p.center, p.turned)
        self._members = Members(team, context.vehicle, zlib.crc32(repr(identity).encode()))
        self._room = FormationRoom(context, team)
        self._meeting = Meeting(
            team, context.vehicle, self._shape, self._room, params.center, params.turned,
            is_led=params.leader is not None,
        )  # fmt: skip
        self._drive = _drive(params, entry)
        self._unemitted: deque[BehaviorEvent] = deque()
        self._last, self._is_new = entry.now, True
        self._frame, self._turned = MovingFrame(entry.position), 0.0
        self._moved = entry.now
        self._taken_for: tuple[float, int, frozenset[int]] | None = None
        self._wait(entry.motion, entry.heading, entry.now)

    def _wait(self, motion: Motion, heading: float, now: Time) -> None:
        """Come to rest, without a place, and wait there for the others."""
        self._rest, self._heading = Rest.after(motion, heading, now), heading
        self._placed: _Placed | None = None
        self._settled = self._is_complete = self._has_emitted = False
        self._point: Vec3 | None = None

    def update(self, tick: Tick) -> Setpoint | Emitting | Done | Failed:
        p = self.params
        if was_held(self._last, tick):
            wanted = tick.setpoint
            if wanted is None or wanted.position is None:
                motion = Motion(tick.known().position, tick.known().velocity)
            else:
                motion = motion_of(wanted)
            self._wait(motion, self._heading, tick.now)
        self._last = tick.now
        team = self._members.heard(tick, self._delay, p.freshness, p.doubt)
        for event in self._members.changes(team, p.doubt):
            if isinstance(event, (NeighbourJoined, NeighbourLost)):
                self._has_emitted = False
            if self._is_complete or not isinstance(event, NeighbourJoined):
                self._unemitted.append(event)
        if self._is_new:
            self._is_new = False
            self._go_on(team, tick)
        ahead = self._drive.hear(tick, p.delay, p.freshness)
        if self._placed is None:
            others, heard = self._members.but_own(team), tick.now - self._delay
            found = self._meeting.assigned(self._rest, others, ahead, heard, p)
            if found is not None:
                self._set_out(found, tick)
                self._catch_up(team)
        output = (
            self._waiting(team, tick)
            if self._placed is None
            else self._flying(self._placed, team, tick)
        )
        if isinstance(output, Setpoint) and self._unemitted:
            return Emitting(output, self._unemitted.popleft())
        return output

    def _go_on(self, team: Team, tick: Tick) -> None:
        """Take over the place in this formation that the vehicle had in the state it just left."""
        before = self._members.own_news(tick)
        if before is None or before.said.place == NO_PLACE:
            return
        frame, said = before.frame, before.said
        place = places.turned_by(said.turned, self._shape[said.place])
        length = distance(place, frame.place(self._rest.coast.at(0.0)).position)
        length = length if length > _IN_PLACE else 0.0
        self._set_out(Assigned(frame, said.turned, said.place, length, (place,)), tick)
        self._settled = said.settled
        if said.path != self._drive.path:  # a member that enters the same path again restarts it
            self._catch_up(team)

    def _catch_up(self, team: Team) -> None:
        """Continue along the path where the other members are."""
        formed = [m.said for m in self._members.but_own(team) if not m.trouble]
        self._drive.join((said.path, said.corner) for said in formed if said.place != NO_PLACE)

    def _set_out(self, found: Assigned, tick: Tick) -> None:
        """Begin to fly to the assigned place."""
        self._frame, self._turned = found.frame, found.turned
        start = found.frame.place(self._rest.at(tick.now))
        limits = (self._most_speed, self.params.acceleration)
        way = WayToPlace(start, found.points, found.length, *limits)
        turn = wrap(self._heading - found.frame.heading)
        self._placed = _Placed(found.place, tick.now, way, turn)

    @property
    def _most_speed(self) -> float:
        return min(self.params.speed, SPEED_SHARE * self._context.airframe.speed)

    def _taken_places(self, own: int, taken: frozenset[int]) -> TakenPlaces:
        """Return the taken places as seen from the place `own`. They are recomputed only if they
        have changed."""
        which = (self._turned, own, taken)
        if self._taken_for != which:
            shape = [places.turned_by(self._turned, place) for place in self._shape]
            self._taken_for, self._taken = which, seen_from(shape, own, taken)
        return self._taken

    def _waiting(self, team: Team, tick: Tick) -> Setpoint | Failed:
        """Return the setpoint of a member that waits for its place, and publish that it waits.
        Fails after `patience`."""
        rest, elapsed = self._rest, (tick.now - self._rest.began) / NS
        self._say(tick, NO_PLACE, rest.coast.end, MovingFrame(ZERO, heading=self._heading))
        setpoint = rest.at(tick.now).setpoint(self._heading)
        come = team.members.keys() - team.troubled.keys()
        missing = [name for name in self._members.others if name not in come]
        if self.params.leader is not None and not missing:
            missing = [self.params.leader]
        who = " and ".join(f"`{name}`" for name in missing)
        lacks = self._meeting.lacks
        self.waits_for = f"{who} to come" if who else lacks or None
        if elapsed > self.params.patience + rest.coast.duration:
            verb = "have" if len(missing) > 1 else "has"
            reason = (
                f"{who or lacks or 'its place'} {verb} not come within {self.params.patience:g} s"
            )
            return Failed(setpoint, reason)
        return setpoint

    def _flying(self, own: _Placed, team: Team, tick: Tick) -> Setpoint | Done | Failed:
        """Move the frame, and return the setpoint of the member's place in it."""
        p, drive, motion = self.params, self._drive, own.way.at((tick.now - own.began) / NS)
        if self._members.goes_first(own.place, team):
            self._wait(self._frame.motion(motion), self._heading, tick.now)
            return self._waiting(team, tick)
        taken = self._taken_places(own.place, team.taken)
        limits = FrameLimits(self._most_speed, p.climb, p.turn_rate, p.acceleration)
        self._move(taken, team, limits, tick)
        wanted = self._frame.motion(motion)
        self._point = wanted.position
        span = max(own.way.duration, MAX_SLOPE * abs(own.turn) / p.turn_rate)
        done = (tick.now - own.began) / NS / span if span > 0.0 else 1.0
        left = own.turn * (1.0 - smoothstep(done)[1]) if done < 1.0 else 0.0
        self._heading = wrap(self._frame.heading + left)
        self._let_feel(team, limits, tick)
        self._judge(own, taken, team, tick)
        self._say(tick, own.place, wanted.position, self._frame)
        setpoint = wanted.setpoint(self._heading, self._frame.rate)
        lost = " and ".join(f"`{name}`" for name in sorted(self._members.lost & team.placed))
        self.waits_for = drive.waits_for or (f"{lost} to recover" if lost else None)
        if self.waits_for is None and tick.now > self._moved + _STANDING_NS:
            self.waits_for = _ROOM
        if drive.lost > p.patience:
            return Failed(setpoint, drive.trouble)
        return Done(setpoint) if drive.ended and self._is_complete else setpoint

    def _move(self, taken: TakenPlaces, team: Team, limits: FrameLimits, tick: Tick) -> None:
        """Move the frame by a tick, slowly enough for the member that lags most."""
        p, frame, share = self.params, self._frame, self._share(team, tick)
        asked = Asked()
        if p.path is None or self._is_complete:
            asked = self._drive.asked(tick, frame, limits)
            asked = Asked(scale(asked.velocity, share), share * asked.rate)
        obstacles = self._room.obstacles(tick, self._delay, team.away)
        fastest = 2.0 * max(limits.speed, limits.climb)
        near = self._room.near(frame, taken, obstacles, fastest, p)
        self._frame = moved(frame, asked, limits, tick.dt, team.frame, taken.reach, near)
        is_kept = bool(near) and norm(asked.velocity) > _STANDING_SPEED >= norm(
            self._frame.velocity
        )
        if isinstance(self._drive, ByHand) or not is_kept:
            self._moved = tick.now

    def _share(self, team: Team, tick: Tick) -> float:
        """Return the fraction (0 to 1) of the requested speed at which no member is left behind."""
        p, lag = self.params, team.lag
        if self._members.is_stopping(team):
            return 0.0
        if self._point is not None:
            lag = max(lag, distance(tick.known().position, self._point))
            if team.frame is not None:
                own = self._frame.place(Motion(self._point))
                theirs = team.frame.motion(own).position
                lag = max(lag, distance(theirs, self._point))
        slow = _LAG_SHARE * p.doubt
        return max(0.0, min(1.0, (p.doubt - lag) / (p.doubt - slow)))

    def _judge(self, own: _Placed, taken: TakenPlaces, team: Team, tick: Tick) -> None:
        """Determine whether the member has settled. Emit `formation_settled` when all have, for the
        first time since one came or was lost."""
        p, seen = self.params, team.positions
        others = [(seen[place], wanted) for place, wanted in taken.near if place in seen]
        error = distance_error(tick.known().position, others)
        arrived = (tick.now - own.began) / NS >= own.way.duration
        bound = p.tolerance * (_UNSETTLED_FACTOR if self._settled else 1.0)
        self._settled = arrived and error <= bound
        self._is_complete = self._settled and self._members.is_settled(team)
        if self._is_complete and not self._has_emitted:
            self._has_emitted = True
            self._unemitted.append(FormationSettled(error=round(error, 4)))

    def _let_feel(self, team: Team, limits: FrameLimits, tick: Tick) -> None:
        """Set the force for the hand: the difference between the swarm's motion and the requested
        one."""
        if isinstance(self._drive, ByHand):
            formed = [m for m in self._members.but_own(team) if m.name in team.placed]
            known = [tick.known(), *(m.estimate for m in formed if m.estimate is not None)]
            velocity = places.centroid(tuple(one.velocity for one in known))
            self.push = self._drive.felt(velocity, self._frame, limits)

    def _say(self, tick: Tick, place: int, point: Vec3, frame: MovingFrame) -> None:
        self.says = InFormation(
            tick.now, self._members.key, self._rest.since, place, self._settled, frame.heading,
            frame.rate, self._turned, point, frame.centre, frame.velocity, self._drive.path,
            self._drive.corner,
        )  # fmt: skip

    @classmethod
    def objections(cls, params: FormationParams, context: VehicleContext) -> Iterator[Objection]:
        team = context.groups.get(params.members, ())
        if context.vehicle not in team:
            return
        wrong = None if params.points else places.objection(params.shape, len(team))
        if wrong is not None:
            hint = "choose another shape, or write your own `points`"
            yield Objection("shape", f"doesn't fit `{params.members}`: {wrong}", hint)
            return
        shape = _shape(params, len(team))
        if len(shape) < len(team):
            reason = f"has {len(shape)} places for the {len(team)} members of `{params.members}`"
            yield Objection("points", reason, "add places")
            return
        widest = 2.0 * max(hull_of(context.diameters.get(name, 0.0)) for name in team)
        apart = places.closest(shape)
        if apart <= widest:
            parameter = "points" if params.points else "side"
            reason = f"puts two places {apart:.3g} m apart, and a vehicle is {widest:.3g} m wide"
            yield Objection(parameter, reason, "increase the distance")
        yield from cls._doubts(params, context)
        if params.leader is not None and params.leader in team:
            yield Objection("leader", "is a member", "name a vehicle that is not a member")
        drives = [k for k in ("input", "path", "leader") if getattr(params, k) is not None]
        if len(drives) > 1:
            yield Objection(drives[1], f"can't be combined with `{drives[0]}`", "write one of them")

    @classmethod
    def _doubts(cls, params: FormationParams, context: VehicleContext) -> Iterator[Objection]:
        unheard = params.speed * params.freshness
        if unheard > params.doubt:
            reason = f"allows a silent member to stray {unheard:.3g} m, more than `doubt`"
            hint = f"write at most {params.doubt / params.speed:.2g} s, or a larger `doubt`"
            yield Objection("freshness", reason, hint, is_doubt=True)
        yield from within_the_rotors(params, context)

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


def _shape(params: FormationParams, count: int) -> tuple[Vec3, ...]:
    return params.points or places.places_of(params.shape, params.side, count)


def _drive(params: FormationParams, entry: Entry) -> Drive:
    if params.input is not None:
        return ByHand(params.input, entry, in_world=params.frame == "world")
    if params.path:
        return AlongPath(params.path, params.heading)
    if params.leader is not None:
        return BehindLeader(params.leader, params.offset)
    return Drive()
