"""A vehicle's link, for receiving (`LinkIn`) and for sending (`LinkOut`), which contain exceptions
of its driver.

An exception fails only this vehicle and is reported once; reading and sending are still attempted
in every tick. `Refused` is not a failure but the vehicle's answer to a request.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, ParamSpec, TypeVar

from kybflow.core.errors import PartFailed, Refused, described
from kybflow.core.geometry import LEVEL, ZERO
from kybflow.core.signals import (
    NS,
    Command,
    Estimate,
    Measurement,
    MeasurementKind,
    Reaction,
    Time,
    Truth,
)
from kybflow.dsl.plan import VehiclePlan
from kybflow.parts import Check, Link, Override
from kybflow.parts.events import ForeignCommandEvent, LinkReturned, VehicleSaid
from kybflow.parts.link import (
    Arms,
    DisarmsByForce,
    Grips,
    Lands,
    NoticesOthers,
    Performs,
    PreparesPreflight,
    Reclaimable,
    ReportsChecks,
    ReportsTouches,
    SendsStatusTexts,
    StopsRotors,
    Subscribable,
    TakesPosition,
    truth_source,
)
from kybflow.runtime.events import Events, VehicleObserver
from kybflow.runtime.scores import VehicleScore

P = ParamSpec("P")
T = TypeVar("T")

LANDING_TIMEOUT_S, MIN_DESCENT = 10.0, 0.2
"""A landing by the vehicle's own land mode may take `LANDING_TIMEOUT_S` plus the height
divided by `MIN_DESCENT` (m/s)."""
SILENCE_THRESHOLD_S = 0.3
"""Seconds without a measurement after which the next one counts as the link's return."""
REQUEST_AGE_S = 0.5
"""Largest age (s) of the vehicle's last measurement at which the vehicle can take requests."""


RESTING = Command(LEVEL, 0.0, ZERO, None, False)
"""The command of a vehicle on the ground: rotors at rest."""
HANDED_OVER = Command(LEVEL, 0.0, ZERO, None)
"""The command recorded while the vehicle's land mode, its watchdog or a pilot flies it: armed,
without thrust."""

Accept = Callable[[Sequence[Measurement], Time], Sequence[Measurement]]


class LinkState(NamedTuple):
    """The status fields of a `Link`, as last read."""

    armed: bool | None = None
    override: Override | None = None
    is_heard: bool = True
    delay: float = 0.0
    rejection: str | None = None


OFFERED = (
    Arms, StopsRotors, DisarmsByForce, Lands, Grips, Performs, TakesPosition, ReportsChecks,
    PreparesPreflight, SendsStatusTexts, NoticesOthers, Reclaimable, ReportsTouches,
)  # fmt: skip
"""What a link may offer. A record contains its answers to `arm`, `land`, `grip`, `perform`,
`disarm_by_force`, `checks`, `status_texts` and `foreign_commands`, its `touch`es, its `state` after
each `read` and `state_after` each request, `offers` (names of these protocols), `ignored` (how many
measurements were delivered in a tick in which none was used), and `failed`: a method that raised,
and why."""


class LinkGuard:
    """Catches and reports the exceptions of a link's driver.

    error: a description of the link's first exception, None while it works. now: the time of the
    tick. observer: records them, and what the link answers.
    """

    __slots__ = ("_driver", "_report", "error", "now", "observer")

    def __init__(
        self,
        driver: str,
        report: Callable[[PartFailed], None],
        observer: VehicleObserver | None = None,
    ) -> None:
        self.error: str | None = None
        self.now: Time = 0
        self.observer = observer or VehicleObserver()
        self._driver, self._report = driver, report

    def fail(self, error: Exception, method: str) -> None:
        """Record a failure of the link, and report the first one. method: the one that raised."""
        self.observer.answer(self.now, "failed", (method, described(error)))
        if self.error is None:
            self.error = described(error)
            self._report(PartFailed(self._driver, error))

    def attempt(
        self, method: str, call: Callable[P, T], *args: P.args, **kwargs: P.kwargs
    ) -> T | None:
        """Call a method of the link and return its result. If it raises, report the exception and
        return None. method: its name."""
        try:
            return call(*args, **kwargs)
        except Exception as error:  # a driver may raise anything
            self.fail(error, method)
            return None


class LinkIn:
    """Receives measurements.

    truth: the simulator's ground truth, None on hardware.
    heard: when measurements last arrived, also from a simulator beside the vehicle; None before the
    first read.
    has_delivered: whether the vehicle has ever delivered a measurement.
    age: seconds since the vehicle's last measurement; before the first one, since the link was
    first read. Messages without a measurement, such as heartbeats, don't count.
    delay: the round-trip time to the vehicle in seconds, zero while unknown.
    rejection: why the vehicle doesn't use the positions that it is sent, None if it does.
    state: the status of the link after the last read or request for an answer.
    faults: the injected faults of the vehicle, None on hardware.
    """

    def __init__(
        self,
        plan: VehiclePlan,
        link: Link,
        guard: LinkGuard,
        events: Events,
        score: VehicleScore,
    ) -> None:
        self.truth: Truth | None = None
        self.heard: Time | None = None
        self.has_delivered = False
        self.age = self.delay = 0.0
        self.rejection: str | None = None
        self.state = LinkState()
        self._alive: Time | None = None
        self._vehicle, self._at, self._events = plan.name, plan.driver.at, events
        self._link, self._guard, self._observer = link, guard, guard.observer
        self._read, self._truth = link.read, truth_source(link)
        self.faults = link.faults
        self._texts = link.status_texts if isinstance(link, SendsStatusTexts) else None
        self._others = link.foreign_commands if isinstance(link, NoticesOthers) else None
        self._score = score
        self._subscribed: frozenset[MeasurementKind] = frozenset()
        self._briefly: frozenset[MeasurementKind] = frozenset()
        offers = [protocol.__name__ for protocol in OFFERED if isinstance(link, protocol)]
        self._observer.answer(0, "offers", offers)
        guard.attempt("state", self.update_state, "state")

    def listen(self, now: Time, accept: Accept) -> Sequence[Measurement]:
        """Read the link; return the measurements that `accept` keeps."""
        measurements: Sequence[Measurement] = ()
        self._guard.now = now
        try:
            measurements = self._read(now)
            self.truth = self._truth()
            self.update_state("state")
            if measurements or self.heard is None:
                is_heard = self.state.is_heard
                if is_heard or self._alive is None:
                    if self._alive is not None and now - self._alive > SILENCE_THRESHOLD_S * NS:
                        back = LinkReturned(value=(now - self._alive) / NS)
                        self._events.emit(back, self._vehicle, self._at)
                    self._alive = now
                    self.has_delivered |= is_heard and bool(measurements)
                self.heard, self.delay = now, self.state.delay
                self.rejection = self.state.rejection
                measurements = self._accepted(measurements, now, accept)
        except Exception as error:  # a driver may raise anything
            self.truth, measurements = None, ()
            self.heard = now if self.heard is None else self.heard
            self._alive = now if self._alive is None else self._alive
            self._guard.fail(error, "read")
        if self._alive is not None:
            self.age = (now - self._alive) / NS
        if self._texts is not None:
            for severity, text in self._told("status_texts", self._texts):
                status = VehicleSaid(severity=severity, text=text)
                self._events.emit(status, self._vehicle, self._at)
        if self._others is not None:
            for reason, allowed in self._told("foreign_commands", self._others):
                self._events.emit(ForeignCommandEvent(reason=reason), self._vehicle, self._at)
                self._score.foreign(reason, allowed)
        return measurements

    def _accepted(
        self, measurements: Sequence[Measurement], now: Time, accept: Accept
    ) -> Sequence[Measurement]:
        accepted = accept(measurements, now)
        if measurements and not accepted:
            self._observer.answer(now, "ignored", len(measurements))
        return accepted

    def update_state(self, of: str) -> None:
        """Read what the link says of itself, and record it as `of` if it has changed."""
        link, last = self._link, self.state
        said = (link.armed, link.override, link.is_heard, link.delay, link.rejection)
        if said != last:
            self.state = LinkState(*said)
            self._observer.answer(self._guard.now, of, said)

    def _told(self, method: str, call: Callable[[], Sequence[T]]) -> Sequence[T]:
        """Return and record what the vehicle says by itself."""
        told = self._guard.attempt(method, call) or ()
        if told:
            self._observer.answer(self._guard.now, method, told)
        return told

    def subscribe(self, kinds: frozenset[MeasurementKind]) -> None:
        """Subscribe to these kinds of measurement, in addition to the previous ones."""
        if kinds <= self._subscribed:
            return
        self._subscribed |= kinds
        self._request_streams()

    def subscribe_briefly(self, kinds: frozenset[MeasurementKind]) -> bool:
        """Also subscribe to these kinds of measurement, until the next call. Return False, without
        any effect, while somebody else controls the vehicle, which is then requested nothing."""
        if self.state.override is not None:
            return False
        self._briefly = kinds
        self._request_streams()
        return True

    def _request_streams(self) -> None:
        if isinstance(self._link, Subscribable):
            self._guard.attempt("subscribe", self._link.subscribe, self._subscribed | self._briefly)

    def checks(self, now: Time) -> Sequence[Check]:
        """Return the vehicle's own preflight checks."""
        if not isinstance(self._link, ReportsChecks):
            return ()
        checks = self._guard.attempt("checks", self._link.checks, now) or ()
        self._observer.answer(now, "checks", [*checks])
        return checks


class LinkOut:
    """Sends commands and requests.

    sent: the last command.
    arming: the command that waits until the vehicle is armed, or None.
    tells_position: whether the vehicle accepts an external position.
    """

    def __init__(self, plan: VehiclePlan, link: Link, guard: LinkGuard, link_in: LinkIn) -> None:
        self.sent = RESTING
        self.arming: Command | None = None
        self._guard, self._send, self._in = guard, link.send, link_in
        self._arm = link.arm if isinstance(link, Arms) else None
        self._cut = link.cut if isinstance(link, StopsRotors) else None
        self._force = link.disarm_by_force if isinstance(link, DisarmsByForce) else None
        self._land = link.land if isinstance(link, Lands) else None
        self._grip = link.grip if isinstance(link, Grips) else None
        self._perform = link.perform if isinstance(link, Performs) else None
        self._reclaim = link.reclaim if isinstance(link, Reclaimable) else None
        self._prepare = link.prepare_preflight if isinstance(link, PreparesPreflight) else None
        self._tell_position = link.tell_position if isinstance(link, TakesPosition) else None
        self.tells_position = self._tell_position is not None
        self._lands, self._lands_blind = plan.driver.cls.lands, plan.driver.cls.lands_blind

    @property
    def override(self) -> Override | None:
        """Why the vehicle doesn't follow commands although its link works, None while it does."""
        return self._in.state.override

    @property
    def armed(self) -> bool | None:
        """Whether the vehicle reports itself armed; None if it reports nothing."""
        return self._in.state.armed

    def prepare_preflight(self, now: Time) -> None:
        """Send the vehicle what its own preflight checks need; nothing if its link has failed."""
        if self._prepare is not None and self._guard.error is None:
            self._guard.attempt("prepare_preflight", self._prepare, now)

    def deliver(self, command: Command, now: Time) -> Command:
        """Send the command of a tick; return the command that was sent. `HANDED_OVER` is not sent.
        The first armed command arms the vehicle, which may take seconds; until then nothing is
        sent, and `RESTING` is returned. Raises Refused if the vehicle refuses to arm."""
        if command is not HANDED_OVER:
            if command.armed and not self.sent.armed and self._arm is not None:
                self.sent = RESTING
                if not self._ask("arm", self._arm, command, now):
                    self.arming = command
                    return RESTING
            self.arming = None
            try:
                self._send(command, now)
            except Exception as error:  # a driver may raise anything
                self._guard.fail(error, "send")
        self.sent = command
        return command

    def _ask(
        self, method: str, call: Callable[P, T], *args: P.args, **kwargs: P.kwargs
    ) -> T | None:
        """Ask the vehicle; record its answer and what its link then says of itself. Raises
        Refused."""
        guard = self._guard
        try:
            answer = call(*args, **kwargs)
            guard.observer.answer(guard.now, method, answer)
            return answer
        except Refused as refused:
            guard.observer.answer(guard.now, method, {"refused": str(refused)})
            raise
        except Exception as error:  # a driver may raise anything
            guard.fail(error, method)
            return None
        finally:
            guard.attempt("state", self._in.update_state, "state_after")

    def cancel_arming(self) -> None:
        """Stop arming for the command of a state that was left."""
        self.arming = None

    def hand_over(self) -> Command:
        """Send nothing, because a pilot or the vehicle itself flies; return the command to
        record."""
        self.sent = HANDED_OVER
        return HANDED_OVER

    def cut(self, now: Time) -> None:
        """Stop the rotors at once."""
        if self._cut is not None:
            self._guard.attempt("cut", self._cut, now)

    def disarm_by_force(self, now: Time) -> None:
        """Disarm a vehicle that stands on the ground. Raises Refused."""
        if self._force is None:
            raise Refused("its driver can't")
        self._ask("disarm_by_force", self._force, now)

    def reclaim(self, now: Time) -> None:
        """Request control back from a pilot."""
        if self._reclaim is not None:
            self._guard.attempt("reclaim", self._reclaim, now)

    def tell_position(self, estimate: Estimate, now: Time) -> None:
        """Send the vehicle its externally measured position."""
        if self._tell_position is not None:
            self._guard.attempt("tell_position", self._tell_position, estimate, now)

    def grip(self, is_open: bool, now: Time) -> None:
        """Open or close the payload's servo. Raises Refused."""
        if self._grip is None:
            raise Refused("it has no servo for a payload")
        self._ask("grip", self._grip, is_open, now)

    def perform(self, act: str, now: Time) -> None:
        """Request one of the driver's actions. Raises Refused."""
        if self._perform is None:
            raise Refused(f"its driver performs no `{act}`")
        self._ask("perform", self._perform, act, now)

    @property
    def can_land(self) -> bool:
        """Whether the vehicle has its own land mode and its link works, so that the mode can be
        requested now."""
        return self._lands and self._guard.error is None and self._in.age <= REQUEST_AGE_S

    def prefers_land_mode(self, reaction: Reaction, *, misled: bool) -> bool:
        """Return whether the vehicle's own land mode replaces the state for `reaction`. misled:
        whether the positions that the vehicle was sent are wrong, so that its filter and its land
        mode are wrong too."""
        lands_blind = self._lands_blind and not (misled and self.tells_position)
        fit = reaction is Reaction.LAND or (reaction is Reaction.LAND_BLIND and lands_blind)
        return fit and self.can_land

    def land(self, now: Time) -> bool:
        """Request the vehicle's own land mode; return whether it has landed. Raises Refused."""
        if self._land is None:
            raise Refused("it has no land mode")
        landed = self._ask("land", self._land, now)
        if landed is None:
            raise Refused(self._guard.error or "its link failed")
        return landed


class LandMode:
    """A landing by the vehicle's own land mode. The failsafe prefers it for the reaction `land`,
    and for `land_blind` if the mode needs no position.

    The autopilot lands by its own estimate, while the runtime sends no commands and requests the
    mode in every tick. If the vehicle refuses or leaves the mode, or has not landed in time (10 s
    plus its height at 0.2 m/s), the state `auto_land` or `land_blind` lands it. land: the link's
    method that requests the mode. height: the vehicle's height above the expected ground (m).
    """

    def __init__(self, land: Callable[[Time], bool], now: Time, height: float) -> None:
        self._land = land
        self._timeout = LANDING_TIMEOUT_S + max(height, 0.0) / MIN_DESCENT
        self._until = now + round(self._timeout * NS)

    def has_landed(self, now: Time) -> bool:
        """Request the land mode, once a tick; return whether the vehicle has landed. Raises Refused
        if the vehicle refuses or has not landed in time."""
        if now > self._until:
            raise Refused(f"it has not landed within {self._timeout:.0f} s")
        return self._land(now)
