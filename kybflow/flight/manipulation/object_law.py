"""The law by which several vehicles move an object together.

Each freedom of the object (`kybflow.world.freedoms`) with the error e and the rate v, the inertia M
with that of the vehicles and the dry friction F, is to have the generalized force

    Q = F sat(w / w0) + M (w - v) / tau + I,    w = clip(e / T, largest speed),    I' = K (w - v)

whose integral I overcomes a friction that is larger than declared, and falls when the object moves
faster than wanted. Three modes follow each other: `align` turns the object to its goal, `push` also
moves it, and `hold` keeps it there. The vehicles only push, and friction brakes: their sum B along
each slide is never larger than Q, and stays below the friction of a slide that is to stay, so that
turning the object doesn't move it on.

The forces f of the vehicles, with the levers L, minimize

    sum_j c_j (L_j f - Q_j)^2 + eps |f - p|^2,    p <= f <= most,    |L_k f| <= B_k

p: a preload that keeps contact. k: the slides with friction.

The law is the project's own. Static pushes by feed-forward of force: arXiv 2306.12167. The sharing
of a load among vehicles by least squares: Fink, Michael, Kim, Kumar, "Planning and control for
cooperative manipulation and transportation with aerial robots", IJRR 30(3), 2011.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal, NamedTuple

from kybflow.world.freedoms import Freedom

Mode = Literal["align", "push", "hold"]
_APPROACH_S, _RESPONSE_S = (3.5, 1.5), (0.7, 0.6)
"""T and tau of a slide and of a turn, s. Rates are measured, and forces act, about 0.3 s late."""
_INTEGRAL_S = 4.0
"""The time of the integral, with which K = M / tau / time, s."""
_NEAR_ZERO, _SLOWEST = 0.3, 0.01
"""w0 of a turn and of a slide, relative to the largest speed. A slide is no longer pushed when it
has arrived, so it needs its friction to the end."""
_TURNED, _STAYS, _BRAKED = 0.9, 0.7, 0.4
"""The largest force along a slide while its object is aligned, while it is to stay, and while it is
to come to rest, relative to its friction."""
_RESTS = 0.02
"""The rate below which a slide counts as at rest, m/s."""
_LIGHTEST = 0.5
"""The smallest preload while a slide brakes, relative to the declared one."""
_ALIGNED_S, _STILL = 1.0, 0.1
"""For how long (s) an object is aligned, at a rate (rad/s) below this, before it is pushed."""
_MISALIGNED = 10.0 / 3.0
_ARRIVED, _DISPLACED = 0.5, 1.5
"""Errors, relative to the tolerance, at which the object is aligned again, held, and pushed
again."""
_TURNING_COST, _PRELOAD_COST = 4.0, 0.01
_SLEW = 2.0
"""Largest rate of a force, N/s."""
_SHORT_S = 2.0
"""How long the forces may not suffice before that is reported, s."""
_UNBOUNDED = 1e30


class Aim(NamedTuple):
    """A freedom in one tick. error: from the coordinate to the goal, None without a goal. rate: of
    the coordinate. tolerance, speed: the error that is allowed, and the largest speed."""

    freedom: Freedom
    error: float | None
    rate: float
    tolerance: float
    speed: float


class Pusher(NamedTuple):
    """A vehicle in contact. levers: the generalized force of its push of 1 N on each freedom. mass:
    in kg. most: its largest force, N."""

    levers: tuple[float, ...]
    mass: float
    most: float


class LawOutput(NamedTuple):
    """forces: of each vehicle, N. short: what the forces can't do, empty if they suffice."""

    forces: Mapping[str, float]
    mode: Mode
    short: str


class ObjectLaw:
    """The law of one object. preload: the least force of each vehicle, N. Give it the same freedoms
    in every tick."""

    def __init__(self, preload: float) -> None:
        self.mode: Mode = "align"
        self._preload = preload
        self._integrals: dict[str, float] = {}
        self._lacks: dict[str, float] = {}
        self._from: dict[str, float] = {}
        self._forces: dict[str, float] = {}
        self._aligned_s = self._short_s = 0.0

    def update(self, aims: Sequence[Aim], pushers: Mapping[str, Pusher], dt: float) -> LawOutput:
        """Return the forces for the next tick."""
        self._switch(aims, pushers, dt)
        moves = [self._is_moved(aim) for aim in aims]
        wanted = [
            self._force(aim, i, pushers, dt) if move else 0.0
            for i, (aim, move) in enumerate(zip(aims, moves, strict=True))
        ]
        forces = self._shared(aims, moves, wanted, pushers)
        for name, force in forces.items():
            last = self._forces.get(name, 0.0)
            forces[name] = min(last + _SLEW * dt, max(last - _SLEW * dt, force))
        self._forces = forces
        given = [
            sum(one.levers[i] * forces[name] for name, one in pushers.items())
            for i in range(len(aims))
        ]
        for aim, force, got in zip(aims, wanted, given, strict=True):
            lack = force - got
            self._lacks[aim.freedom.name] = lack if abs(lack) > 0.1 * abs(force) else 0.0
        return LawOutput(forces, self.mode, self._short(aims, wanted, given, dt))

    def _is_moved(self, aim: Aim) -> bool:
        """Return whether a freedom is to move now: an aligned object that is held is left alone,
        for each turn of it could move its slide on."""
        if not aim.freedom.turns or self.mode != "hold":
            return aim.error is not None and (aim.freedom.turns or self.mode == "push")
        near = abs(aim.error or 0.0) < _ARRIVED * aim.tolerance
        return aim.error is not None and not (near and abs(aim.rate) < _STILL)

    def _switch(self, aims: Sequence[Aim], pushers: Mapping[str, Pusher], dt: float) -> None:
        """Change the mode, if it is time."""
        turns = [a for a in aims if a.error is not None and a.freedom.turns]
        moves = [(i, a) for i, a in enumerate(aims) if a.error is not None and not a.freedom.turns]
        aligned = all(abs(a.error or 0.0) < a.tolerance and abs(a.rate) < _STILL for a in turns)
        lost = any(abs(a.error or 0.0) > _MISALIGNED * a.tolerance for a in turns)
        self._aligned_s = self._aligned_s + dt if aligned else 0.0
        displaced = any(
            abs(a.error or 0.0) > _DISPLACED * a.tolerance and self._can_move(i, a, pushers)
            for i, a in moves
        )
        arrived = all(
            abs(error := a.error or 0.0) < _ARRIVED * a.tolerance
            or error * self._from.get(a.freedom.name, error) < 0.0
            for _, a in moves
        )
        mode = self.mode
        if lost:
            mode = "align"
        elif self.mode == "push":
            mode = "hold" if arrived else "push"
        elif self._aligned_s >= _ALIGNED_S:
            mode = "push" if displaced else "hold"
        if mode != self.mode:
            self.mode, self._from = mode, {a.freedom.name: a.error or 0.0 for _, a in moves}
            for _, a in moves:
                self._integrals.pop(a.freedom.name, None)

    def _can_move(self, index: int, aim: Aim, pushers: Mapping[str, Pusher]) -> bool:
        """Return whether all pushers together overcome the friction towards the goal."""
        ahead = 1.0 if (aim.error or 0.0) > 0.0 else -1.0
        most = sum(max(0.0, ahead * one.levers[index]) * one.most for one in pushers.values())
        return most > aim.freedom.friction

    def _force(self, aim: Aim, index: int, pushers: Mapping[str, Pusher], dt: float) -> float:
        """Return the generalized force that a freedom is to have."""
        free, limit = aim.freedom, aim.speed
        speed = min(limit, max(-limit, (aim.error or 0.0) / _APPROACH_S[free.turns]))
        moved = free.inertia + sum(p.mass * p.levers[index] ** 2 for p in pushers.values())
        stiff = moved / _RESPONSE_S[free.turns]
        most = free.friction + stiff * limit
        integral, lack = self._integrals.get(free.name, 0.0), self._lacks.get(free.name, 0.0)
        if lack * (speed - aim.rate) <= 0.0:  # else it would only wind up
            integral += stiff / _INTEGRAL_S * (speed - aim.rate) * dt
            integral = self._integrals[free.name] = min(most, max(-most, integral))
        slow = _NEAR_ZERO * limit if free.turns else _SLOWEST * limit
        friction = free.friction * min(1.0, max(-1.0, speed / slow))
        return friction + stiff * (speed - aim.rate) + integral

    def _shared(
        self,
        aims: Sequence[Aim],
        moves: Sequence[bool],
        wanted: Sequence[float],
        pushers: Mapping[str, Pusher],
    ) -> dict[str, float]:
        """Return the force of each vehicle."""
        import daqp
        import numpy as np

        levers: Any = np.array([one.levers for one in pushers.values()]).T
        n, preload = len(pushers), self._preload
        cost, pull = np.eye(n) * _PRELOAD_COST, np.zeros(n)
        rows: list[Any] = []
        caps: list[float] = []
        for aim, move, force, row in zip(aims, moves, wanted, levers, strict=True):
            if move:
                arm = np.abs(row).max() if aim.freedom.turns else 1.0
                weight = _TURNING_COST / max(arm, 1e-3) ** 2 if aim.freedom.turns else 1.0
                cost += weight * np.outer(row, row)
                pull += weight * force * row
            if aim.freedom.friction and not aim.freedom.turns:
                least = abs(float(row.sum())) * self._preload
                rests = not move and abs(aim.rate) < _RESTS
                share = _BRAKED if not rests else _STAYS if self.mode == "hold" else _TURNED
                cap = share * aim.freedom.friction
                rows.append(row)
                caps.append(max(cap, abs(force), _LIGHTEST * least))
                if least > caps[-1]:
                    preload = min(preload, self._preload * caps[-1] / least)
        pull += _PRELOAD_COST * preload
        most = np.array([max(one.most, preload) for one in pushers.values()])
        bound = np.array(caps)
        x, _, flag, _ = daqp.solve(
            cost, -pull, np.ascontiguousarray(np.array(rows).reshape(len(rows), n)),
            np.concatenate((most, bound)), np.concatenate((np.full(n, preload), -bound)),
        )  # fmt: skip
        shared = x if flag >= 1 else np.full(n, preload)
        return dict(zip(pushers, map(float, shared), strict=True))

    def _short(
        self,
        aims: Sequence[Aim],
        wanted: Sequence[float],
        given: Sequence[float],
        dt: float,
    ) -> str:
        """Return what the forces have not sufficed for long, or an empty text."""
        short = ""
        for aim, force, got in zip(aims, wanted, given, strict=True):
            error, friction = aim.error or 0.0, aim.freedom.friction
            if abs(error) < _DISPLACED * aim.tolerance or (self.mode == "align" and not force):
                continue
            ahead = 1.0 if error > 0.0 else -1.0
            if got * ahead <= friction and (force * ahead > friction or not force):
                unit = "N m" if aim.freedom.turns else "N"
                short = (
                    f"`{aim.freedom.name}` needs more than {friction:.2g} {unit} towards its goal, "
                    f"and the vehicles give {got * ahead:.2f} {unit}"
                )
        self._short_s = self._short_s + dt if short else 0.0
        return short if self._short_s >= _SHORT_S else ""
