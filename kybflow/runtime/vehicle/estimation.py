"""Selects the estimator that a vehicle flies on: the first healthy one in the mission's list, with
hysteresis.

If no estimator has been healthy for long enough, one that has just become healthy is used:
hysteresis must not leave a vehicle without an estimate. Hysteresis doesn't apply either if an
estimator contradicts the one in use, by more than `MAX_DISTANCE` plus four times both spreads: one
of them is wrong, and the mission lists the most trusted one first.

An estimator that raises, or whose estimate is not finite, is removed. In every tick the estimators
that are not in use can align themselves with the estimate in use (`Estimator.anchor`). An event
reports when an estimator begins to refuse measured positions, and when it accepts them again. A
behavior may name the estimators that it prefers. `EstimateBlend`
smooths the change from one estimator to another.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import exp
from typing import Any

from kybflow.core.errors import PartFailed
from kybflow.core.geometry import (
    ZERO,
    Vec3,
    add,
    distance,
    from_heading,
    heading_of,
    multiply,
    norm,
    scale,
    sub,
    wrap,
)
from kybflow.core.signals import NS, Estimate, Imu, Measurement, MeasurementKind, Time
from kybflow.core.units import DEG
from kybflow.dsl.plan import EstimatorPlan, VehiclePlan
from kybflow.flight.pose_gate import Refusal
from kybflow.parts import Estimator
from kybflow.parts.events import (
    EstimatorChanged,
    EstimatorLost,
    PositionAccepted,
    PositionRefused,
)
from kybflow.runtime.conditions import reader_of
from kybflow.runtime.estimator_view import EstimatorView
from kybflow.runtime.events import Events
from kybflow.runtime.finite import checked_estimate
from kybflow.runtime.making import make
from kybflow.runtime.scores import VehicleScore
from kybflow.world.vehicle_context import VehicleContext

DECAY_RATE = 1.5
MAX_DISTANCE, MAX_SPEED, MAX_ANGLE = 0.3, 0.5, 20.0 * DEG
BLEND_TIME_S = 8.0
"""Seconds after which a blend ends; 20 micrometres of the largest offset are left then."""


class EstimateBlend:
    """Keeps the estimate continuous when a vehicle changes its estimator.

    The last output, extrapolated by a tick, differs from the new estimate by x0 in position and
    v0 in velocity. Both differences are added to the new estimate and decay, critically damped.
    Thus the output starts at the last position and velocity, and its velocity is always the
    derivative of its position:

        x(t) = (x0 + (v0 + n x0) t) exp(-n t),   n = 1.5 1/s

    With v0 = 0 the offset moves by at most n / e = 0.55 of x0 per second; a tracker with
    TeleKyb's gains (9.0, 7.5) follows that within 2 cm for the largest x0. The heading is
    blended likewise, by a rotation about world z; the body rates stay unchanged.

    If the last output is more than 0.3 m or 20 degrees off the new estimate, it was wrong:
    nothing is added, and the estimate steps. The processor `position_error` detects the step
    and brakes at the new position. 0.3 m is also the distance within which a new behavior
    trusts the last setpoint (`Entry.position`). A velocity difference of more than 0.5 m/s is
    treated as noise: the new velocity is used at once, and the position offset decays with v0 =
    0.

    time: when the estimator changed.
    """

    __slots__ = ("_position", "_pull", "_turn", "_velocity", "time")

    def __init__(self, time: Time, position: Vec3, velocity: Vec3, turn: float) -> None:
        self.time = time
        self._position, self._velocity, self._turn = position, velocity, turn
        self._pull = add(velocity, scale(position, DECAY_RATE))

    @classmethod
    def between(cls, last: Estimate, new: Estimate) -> tuple[float, EstimateBlend | None]:
        """Return the distance (m) from `new` to the extrapolated `last` output, and the blend
        between them, or None if the estimate must step."""
        gone = (new.time - last.time) / NS
        position = sub(add(last.position, scale(last.velocity, gone)), new.position)
        velocity = sub(last.velocity, new.velocity)
        turn = wrap(heading_of(last.attitude) - heading_of(new.attitude))
        far = norm(position)
        if far > MAX_DISTANCE or abs(turn) > MAX_ANGLE:
            return far, None
        if norm(velocity) > MAX_SPEED:
            velocity = ZERO
        return far, cls(new.time, position, velocity, turn)

    def applied(self, estimate: Estimate) -> Estimate:
        """Return `estimate` plus the part of the offset that remains at the estimate's time."""
        t = (estimate.time - self.time) / NS
        fading = exp(-DECAY_RATE * t)
        pull = self._pull
        x = scale(add(self._position, scale(pull, t)), fading)
        v = scale(sub(self._velocity, scale(pull, DECAY_RATE * t)), fading)
        turn = self._turn * (1.0 + DECAY_RATE * t) * fading
        return estimate._replace(
            position=add(estimate.position, x),
            velocity=add(estimate.velocity, v),
            attitude=multiply(from_heading(turn), estimate.attitude),
        )

    def is_over(self, now: Time) -> bool:
        return (now - self.time) / NS > BLEND_TIME_S


Known = Callable[[frozenset[MeasurementKind]], str]
_INERTIAL = frozenset({Imu})
"""The kinds of measurement that dead reckoning uses."""


class Candidate:
    """One estimator of a vehicle, and its health.

    An estimator is healthy while its health condition holds for its last estimate. After a loss of
    health, the condition must hold for `recover_after` seconds before the estimator is preferred to
    another; it is used at once if there is no other, or if it contradicts the one in use.

    `for_at_most` limits the time of use, which counts up while this estimator is in use and down
    while another is. An estimator that has reached the limit may be used again once the count is
    back at zero, so that a moment on another estimator doesn't renew the limit.
    """

    def __init__(self, plan: EstimatorPlan, context: VehicleContext) -> None:
        self.label, self.at = plan.part.label, plan.part.at
        self.name = self.label.rpartition(".")[2]
        self.part: Estimator[Any] = make(plan.part, plan.part.params, context)
        self.uses = plan.part.cls.uses(plan.part.params)
        self.estimate: Estimate | None = None
        self.has_failed = False
        self.anchors = type(self.part).anchor is not Estimator.anchor
        self.refusal: Refusal | None = None
        self._recover = round(plan.recover_after * NS)
        self._at_most = None if plan.for_at_most is None else round(plan.for_at_most * NS)
        self._used: Time = 0
        self._is_spent = False
        self._healthy_since: Time | None = None
        self._was_lost = False
        self._holds: Callable[[], bool] = lambda: True
        if plan.healthy is not None:
            views = {self.name: EstimatorView(self)}
            self._holds = reader_of(plan.healthy, views, self.name, lambda: 0.0)

    def update(
        self, measurements: Sequence[Measurement], now: Time, flown: Estimate | None
    ) -> bool:
        """Process the measurements; return whether the estimator may be used now. flown: the
        estimate on which the vehicle flew until now. Raises any exception of the part, and
        ValueError if the estimate is not finite."""
        self.estimate = estimate = self.part.update(measurements, now)
        if estimate is not None:
            checked_estimate(estimate)
        if estimate is None or not self._holds():
            self._was_lost = self._was_lost or self._healthy_since is not None
            self._healthy_since = None
            return False
        if self._healthy_since is None:
            self._healthy_since = now
        if self._was_lost and now - self._healthy_since < self._recover:
            if not _contradicts(estimate, flown):
                return False
            self._was_lost = False
        return not self._is_spent

    def fail(self) -> None:
        """Mark the estimator as failed, because it raised."""
        self.has_failed = True

    def note_refusal(self, now: Time) -> PositionRefused | PositionAccepted:
        """Record that the estimator has begun or stopped refusing measured positions; return the
        event for it."""
        before, self.refusal = self.refusal, self.part.refusal
        if self.refusal is not None:
            return PositionRefused(estimator=self.name, reason=self.refusal.reason)
        assert before is not None
        return PositionAccepted(estimator=self.name, value=(now - before.since) / NS)

    @property
    def is_bounded(self) -> bool:
        """Whether the estimator's time of use is limited."""
        return self._at_most is not None

    @property
    def is_usable(self) -> bool:
        """Whether the estimator is healthy, however briefly, and within its time limit."""
        return self._healthy_since is not None and not self._is_spent

    def count(self, passed: Time, used: Candidate) -> None:
        """Update the time of use: `used` was in use for `passed` nanoseconds. Requires
        `is_bounded`."""
        assert self._at_most is not None
        self._used = self._used + passed if used is self else max(self._used - passed, 0)
        self._is_spent = self._used >= self._at_most or (self._is_spent and self._used > 0)

    @property
    def is_starved(self) -> bool:
        """Whether the estimator is unhealthy because of its measurements, not because it raised."""
        return not self.has_failed and self._healthy_since is None

    @property
    def trouble(self) -> str:
        """Why the estimator can't be used now, for an event; empty if it can."""
        estimate = self.estimate
        if self.has_failed:
            return f"`{self.name}` failed"
        if estimate is None:
            return f"`{self.name}` has no estimate"
        if self._healthy_since is None:
            figures = f"age {estimate.age:.3f} s, spread {estimate.spread:.3f} m"
            return f"`{self.name}` is not healthy: {figures}"
        if self._at_most is not None and self._is_spent:
            return f"`{self.name}` may be used for {self._at_most / NS:g} s at most"
        return ""


class Estimation:
    """A vehicle's estimators. report: is called with the failure of an estimator. known: returns a
    description of the known faults of the given kinds of measurement, empty without any.

    lost: the last estimate before there was none, None before that.
    """

    def __init__(
        self,
        plan: VehiclePlan,
        context: VehicleContext,
        events: Events,
        score: VehicleScore,
        report: Callable[[PartFailed], None],
        known: Known = lambda _: "",
    ) -> None:
        self.lost: Estimate | None = None
        self._listed = [Candidate(estimator, context) for estimator in plan.estimators]
        self._candidates = self._listed
        self._anchored = [candidate for candidate in self._listed if candidate.anchors]
        self._others = self._anchored
        self._preferred: tuple[str, ...] = ()
        self._is_reordered = False
        self._bounded = [candidate for candidate in self._candidates if candidate.is_bounded]
        self._in_use: Candidate | None = None
        self._flown: Estimate | None = None
        self._blend: EstimateBlend | None = None
        self._was_used = False
        self._time: Time = 0
        self._vehicle, self._events, self._score, self._report = plan.name, events, score, report
        self._known = known

    def update(self, measurements: Sequence[Measurement], now: Time) -> Estimate | None:
        """Process the measurements; return the estimate of the first healthy estimator, blended
        after a change of estimator, or None if no estimator is healthy."""
        if self._bounded:
            self._count(now)
        chosen: Candidate | None = None
        used = self._in_use
        flown = None if used is None else used.estimate
        for candidate in self._candidates:
            try:
                if candidate.update(measurements, now, flown) and chosen is None:
                    chosen = candidate
            except (Exception, SystemExit) as error:  # a part may raise anything
                self._fail(candidate, error)
            if candidate.part.refusal is not candidate.refusal:
                self._events.emit(candidate.note_refusal(now), self._vehicle, candidate.at)
        if chosen is None:
            chosen = next((c for c in self._candidates if c.is_usable), None)
        estimate = chosen.estimate if chosen is not None else None
        if chosen is not self._in_use:
            self._change(chosen, estimate, now)
        self._is_reordered = False
        self._flown = estimate if self._blend is None else self._blended(estimate, now)
        if self._others and estimate is not None:
            self._anchor(estimate)
        return self._flown

    def prefer(self, names: tuple[str, ...]) -> None:
        """Put the named estimators first, in the given order. The others follow in the mission's
        order."""
        if names == self._preferred:
            return
        self._preferred, self._is_reordered = names, True
        rank = {name: index for index, name in enumerate(names)}
        living = [candidate for candidate in self._listed if not candidate.has_failed]
        self._candidates = sorted(living, key=lambda c: rank.get(c.name, len(rank)))

    @property
    def candidates(self) -> Sequence[Candidate]:
        """The estimators that have not failed, in the current order of preference."""
        return self._candidates

    def kill(self, names: frozenset[str]) -> None:
        """Fail the estimators of these names as if they had raised."""
        for candidate in self._candidates:
            if candidate.name in names:
                self._fail(candidate, RuntimeError("killed by a fault of the mission"))

    @property
    def source(self) -> str | None:
        """The name of the estimator in use."""
        return self._in_use.name if self._in_use is not None else None

    def parts(self) -> dict[str, Any]:
        """Return the estimators that have not failed, by label."""
        return {candidate.label: candidate.part for candidate in self._candidates}

    def _count(self, now: Time) -> None:
        passed, self._time = now - self._time, now
        used = self._in_use
        if used is not None:
            for candidate in self._bounded:
                candidate.count(passed, used)

    def _anchor(self, estimate: Estimate) -> None:
        """Pass the estimate in use, without the offset of a blend, to the other estimators."""
        for candidate in self._others:
            try:
                candidate.part.anchor(estimate)
            except (Exception, SystemExit) as error:  # a part may raise anything
                self._fail(candidate, error)

    def _fail(self, failed: Candidate, error: BaseException) -> None:
        failed.fail()
        self._candidates = [c for c in self._candidates if c is not failed]
        self._bounded = [c for c in self._bounded if c is not failed]
        self._anchored = [c for c in self._anchored if c is not failed]
        self._others = [c for c in self._others if c is not failed]
        self._report(PartFailed(failed.label, error))

    def _blended(self, estimate: Estimate | None, now: Time) -> Estimate | None:
        if self._blend is None or estimate is None:
            return estimate
        if self._blend.is_over(now):
            self._blend = None
            return estimate
        return self._blend.applied(estimate)

    def _change(self, chosen: Candidate | None, estimate: Estimate | None, now: Time) -> None:
        previous, self._in_use = self._in_use, chosen
        self._others = [c for c in self._anchored if c is not chosen]
        before, reason = None, "there was none" if self._was_used else "the first estimate"
        at = "" if chosen is None else chosen.at
        if previous is not None:
            before, reason = previous.name, previous.trouble
            at = previous.at if reason else at
            known = self._known(previous.uses) if previous.is_starved else ""
            if known:
                reason += f"; {known}"
        self._was_used = True
        last, self._blend = self._flown, None
        if chosen is None or estimate is None:
            self.lost = last
            self._events.emit(EstimatorLost(previous=before, reason=reason), self._vehicle, at)
            self._score.estimator("", now / NS)
            return
        gain = f"`{chosen.name}` is healthy again"
        if self._is_reordered:
            when = "in this behavior" if self._preferred else "again"
            gain = f"`{chosen.name}` comes first {when}"
        offset = 0.0
        if last is not None:
            offset, self._blend = EstimateBlend.between(last, estimate)
        changed = EstimatorChanged(
            estimator=chosen.name,
            previous=before,
            reason=reason or gain,
            offset=offset,
            blended=self._blend is not None,
        )
        self._events.emit(changed, self._vehicle, at)
        self._score.estimator(chosen.name, now / NS)


class ExternalPosition:
    """Selects the estimate that is sent to a vehicle as its external position (an autopilot's
    external vision).

    This is the estimate in use, unless that comes from the vehicle itself or from dead reckoning
    that continues the vehicle's own estimate; then it is the estimate of the first usable external
    estimator. Otherwise the autopilot would mistake its own estimate for an independent one, and
    the loss of its position would go unnoticed.
    """

    def __init__(self, plan: VehiclePlan, estimation: Estimation) -> None:
        self._estimation = estimation
        self._own, self._inertial = set[str](), set[str]()
        self._is_echo = False
        for part in (estimator.part for estimator in plan.estimators):
            name = part.label.rpartition(".")[2]
            if part.cls.own:
                self._own.add(name)
            elif part.cls.uses(part.params) <= _INERTIAL:
                self._inertial.add(name)

    def of(self, flown: Estimate | None) -> Estimate | None:
        """Return the estimate to send in this tick, or None. flown: the estimate in use."""
        source = self._estimation.source
        if source is None:
            return None
        if source in self._own:
            self._is_echo = True
        elif source not in self._inertial:
            self._is_echo = False
        if not self._is_echo:
            return flown
        inside = self._own | self._inertial
        for candidate in self._estimation.candidates:
            if candidate.name not in inside and candidate.is_usable:
                return candidate.estimate
        return None


def _contradicts(estimate: Estimate, flown: Estimate | None) -> bool:
    if flown is None:
        return False
    off = distance(estimate.position, flown.position)
    return off > MAX_DISTANCE + 4.0 * (estimate.spread + flown.spread)
