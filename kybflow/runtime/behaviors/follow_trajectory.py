"""Fly a trajectory from a file, row by row in time, once the vehicle is at its first point.

    clover.csv:  t, x, y, z, vx, vy, vz, yaw [deg]
                 0, 0, 0, 1, 0,  0,  0,  0
                 ...

A table of values separated by commas, semicolons or tabs: t, x, y, z are needed; velocities (vx,
vy, vz), accelerations (ax, ay, az) and yaw may follow. Without a unit in the header (`x [cm]`) a
column is SI; yaw says `[deg]` or `[rad]`. Between rows it flies quintic pieces without a step in
position, velocity or acceleration; derivatives that the file doesn't give come from splines
(`kybflow.flight.trajectory`). Polynomial pieces of uav_trajectories, for Crazyswarm, are read as
well, as coordinates of the world (`kybflow.flight.polynomial_pieces`). The file must be in the
mission's folder or below it, and begin and end at rest. It is checked with the mission: its format,
positions, speeds and accelerations.

Start gate: it refuses to start further than `gate` from the first point (TeleKyb's playback had
0.5 m as well). Otherwise it flies there in a straight line and turns to the first yaw. The file's
time starts when the vehicle has been within `tolerance` of the point and slower than `slower_than`
for `dwell`. Fails if that has not happened `patience` after the planned time. Done at the last row.
Without a yaw the heading is kept. World frame.
"""

from __future__ import annotations

from kybflow.core.errors import Refused
from kybflow.core.files import File
from kybflow.core.geometry import Vec3, distance, norm, wrap
from kybflow.core.signals import Done, Failed, Setpoint, SetpointKind, Tick
from kybflow.core.units import Acceleration, AngularRate, Duration, Length, Speed
from kybflow.flight.motion import Coast, Dwell, Profile, Straight, Turn
from kybflow.flight.trajectory import read_trajectory
from kybflow.parts import AIR, Behavior, Entry, Footprint, Origin, param, params


@params
class FollowTrajectoryParams:
    file: File = param("The table of the trajectory.", read_only=True, reads=read_trajectory)
    gate: Length = param(
        "Largest distance from the first point at which the behavior starts.",
        default=0.5, above=0.0, read_only=True, room="across",
    )  # fmt: skip
    approach: Speed = param(
        "Largest speed on the way to the first point.", default=0.5, above=0.0, read_only=True
    )
    acceleration: Acceleration = param(
        "Largest acceleration on the way to the first point.",
        default=0.7, above=0.0, read_only=True,
    )  # fmt: skip
    turn_rate: AngularRate = param(
        "Largest rate of turning to the first yaw.", default=1.0, above=0.0, read_only=True
    )
    tolerance: Length = param(
        "Distance from the first point that counts as arrived.",
        default=0.05,
        above=0.0,
        room="across",
    )
    slower_than: Speed = param("Speed that counts as at rest.", default=0.1, above=0.0)
    dwell: Duration = param(
        "Time that the vehicle must be at rest at the first point.",
        default=0.3,
        at_least=0.0,
        limited_by="patience",
    )
    patience: Duration = param(
        "Time past the planned arrival at the first point after which the behavior fails.",
        default=10.0, above=0.0,
    )  # fmt: skip


class FollowTrajectory(
    Behavior[FollowTrajectoryParams], flight=AIR >> AIR, emits=SetpointKind.POSITION
):
    def __init__(self, params: FollowTrajectoryParams, entry: Entry) -> None:
        super().__init__(params, entry)
        reason = self.refusal(params, entry.position)
        if reason is not None:
            raise Refused(reason)
        self._curve = read_trajectory(params.file)
        _, heading, _ = self._curve.at(0.0)
        self._coast = Coast.after(entry.motion)
        speed = entry.cruise_speed(params.approach)
        self._lead = Straight(self._coast.end, self._curve.start, speed, params.acceleration)
        self._heading = entry.heading
        self._turn = Turn(entry.heading, heading, params.turn_rate)
        self._arrival = max(self._coast.duration, self._lead.duration, self._turn.duration)
        self._there = Dwell()
        self._begun: float | None = None

    def update(self, tick: Tick) -> Setpoint | Done | Failed:
        if self._begun is None:
            return self._approach(tick)
        time = tick.elapsed - self._begun
        motion, heading, rate = self._curve.at(time)
        setpoint = motion.setpoint(self._heading if heading is None else wrap(heading), rate)
        return Done(setpoint) if time >= self._curve.duration else setpoint

    def _approach(self, tick: Tick) -> Setpoint | Failed:
        time, p = tick.elapsed, self.params
        motion = self._lead.at(time)
        if time < self._coast.duration:
            motion = motion.plus(self._coast.shift(time))
        setpoint = motion.setpoint(*self._turn.at(time))
        if time < self._arrival:
            return setpoint
        known = tick.known()
        gap = distance(known.position, self._curve.start)
        rests = gap <= p.tolerance and norm(known.velocity) <= p.slower_than
        if self._there.reached(rests, p.dwell, tick.dt):
            self._begun = time
        elif time > self._arrival + p.patience:
            return Failed(setpoint, f"not at rest at the first point, {gap:.3f} m from it")
        return setpoint

    @classmethod
    def footprint(cls, params: FollowTrajectoryParams, entry: Vec3 | None) -> Footprint | None:
        curve = read_trajectory(params.file)
        figures, name = curve.figures, params.file.name
        path = tuple(position for position, _ in figures.points)
        lines = {position: f"{name}:{line}" for position, line in figures.points}
        gap = 0.0 if entry is None else distance(entry, path[0])
        approach = 0.0 if gap == 0.0 else params.approach
        lead = Profile.within(gap, params.approach, params.acceleration)
        return Footprint(
            path if entry is None else (entry, *path),
            max(figures.speed, approach),
            curve.end,
            acceleration=figures.acceleration,
            path=path if entry is None else (entry, *path),
            origin=Origin(lines, f"{name}:{figures.fastest}", f"{name}:{figures.sharpest}"),
            duration=lead.duration + params.dwell + curve.duration,
            goals=((path[0], params.tolerance),),
        )

    @classmethod
    def refusal(cls, params: FollowTrajectoryParams, entry: Vec3) -> str | None:
        gap = distance(entry, read_trajectory(params.file).start)
        if gap <= params.gate:
            return None
        return f"{gap:.2f} m from the first point of `{params.file}`, {params.gate:g} m allowed"
