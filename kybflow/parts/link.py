"""A vehicle's link: the engine reads measurements from it and sends it commands, once a tick.

A link must `read` and `send`. It offers each further capability by implementing one of the
protocols below, which the runtime finds with `isinstance`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol, runtime_checkable

from kybflow.core.signals import Command, Estimate, Measurement, MeasurementKind, Time, Truth
from kybflow.parts.fault import ActiveFaults


class Check(NamedTuple):
    """A preflight check by the vehicle itself: its name, whether it passed, and what was found and
    must change (with an optional table, `kybflow.core.details`). waits: it may still pass by
    itself."""

    name: str
    green: bool
    reason: str
    waits: bool = True


class StatusText(NamedTuple):
    """A message from the vehicle in its own words. severity: `critical`, `error`, `warning`, or
    `notice` and less."""

    severity: str
    text: str


class ForeignCommand(NamedTuple):
    """A command that another program or person gave a vehicle, in words. allowed: whether the run
    may still succeed."""

    reason: str
    allowed: bool


class Override(NamedTuple):
    """Why a vehicle with a working link doesn't follow commands. lands: its own failsafe controls
    it, not a person, and it must land. refused: why a request for control was refused; empty
    before a request and until it is answered."""

    reason: str
    lands: bool = False
    refused: str = ""


class Link(ABC):
    """One vehicle's connection.

    faults: act on a simulated vehicle, or on our side of the link to one; None on hardware.
    override: why the vehicle doesn't follow commands, because a pilot flies it or it changed its
    mode by itself; None while it follows. While overridden, the link sends no command until the
    operator requests control (`Reclaimable`). armed: whether the vehicle reports that it is armed;
    None if it reports nothing. is_heard: whether the last `read` received data from the vehicle
    itself, not only from a simulator beside it. delay: seconds of a round trip to the vehicle, the
    shorter one of the newest two, so that a single slow one doesn't count; zero while unknown.
    """

    faults: ActiveFaults | None = None
    override: Override | None = None
    armed: bool | None = None
    is_heard: bool = True
    delay: float = 0.0

    @abstractmethod
    def read(self, now: Time) -> Sequence[Measurement]:
        """Return the measurements that arrived since the last call, oldest first. A measurement
        more than 5 ms later than `now` is discarded and reported. Raises DriverError."""

    @abstractmethod
    def send(self, command: Command, now: Time) -> None:
        """Send the newest command. Raises DriverError."""


@runtime_checkable
class Subscribable(Protocol):
    """A link that delivers some kinds of measurement only on demand."""

    def subscribe(self, kinds: frozenset[MeasurementKind]) -> None:
        """Deliver at least these kinds from now on, if the driver provides them."""


@runtime_checkable
class Arms(Protocol):
    """A vehicle that must be armed before it follows commands."""

    def arm(self, command: Command, now: Time) -> bool:
        """Arm; return whether the rotors turn and the vehicle follows commands. Called once a tick
        in place of `send`, from the first armed command until it returns True, while the behavior's
        time stands still. command: what the behavior commands meanwhile. Raises Refused with the
        vehicle's own words; DriverError."""


@runtime_checkable
class StopsRotors(Protocol):
    """A vehicle whose rotors can be stopped in the air."""

    def cut(self, now: Time) -> None:
        """Stop the rotors at once, in flight. Disarmed commands follow."""


@runtime_checkable
class DisarmsByForce(Protocol):
    """A vehicle that may stay armed on the ground."""

    def disarm_by_force(self, now: Time) -> None:
        """Disarm a vehicle that stands on the ground and was asked to in vain. Raises Refused if it
        says that it flies."""


@runtime_checkable
class Lands(Protocol):
    """A vehicle that has its own land mode."""

    def land(self, now: Time) -> bool:
        """Land in the vehicle's own land mode; return whether it is on the ground with its rotors
        at rest. Called once a tick in place of `send` while the failsafe lands a vehicle whose
        driver `lands`: the first call starts the mode, the next `send` ends it. Raises Refused with
        the vehicle's own words if it refuses or stops landing; DriverError."""


@runtime_checkable
class Grips(Protocol):
    """A vehicle with a servo that holds a payload."""

    def grip(self, is_open: bool, now: Time) -> None:
        """Open or close the servo on the channel that the vehicle's context names. Called every
        tick until a Payload measurement acknowledges it, so a bad link loses nothing; the link
        repeats the request as its protocol requires. Raises Refused with the vehicle's own words;
        DriverError."""


@runtime_checkable
class Performs(Protocol):
    """A vehicle that performs the acts of its driver."""

    def perform(self, act: str, now: Time) -> None:
        """Ask the vehicle once for one of the driver's `acts`. Raises Refused with what speaks
        against it now; DriverError."""


@runtime_checkable
class TakesPosition(Protocol):
    """A vehicle that fuses an external position, such as an autopilot without GPS."""

    def tell_position(self, estimate: Estimate, now: Time) -> None:
        """Send the vehicle its position; called once a tick while it is known."""


@runtime_checkable
class ReportsChecks(Protocol):
    """A vehicle that answers preflight checks itself."""

    def checks(self, now: Time) -> Sequence[Check]:
        """Return the vehicle's own preflight checks; called once a tick until all have passed."""


@runtime_checkable
class SendsStatusTexts(Protocol):
    """A vehicle that sends messages in words."""

    def status_texts(self) -> Sequence[StatusText]:
        """Return the messages since the last call, oldest first, each once."""


@runtime_checkable
class NoticesOthers(Protocol):
    """A vehicle that others may command too, beside this program."""

    def foreign_commands(self) -> Sequence[ForeignCommand]:
        """Return what others were noticed to command since the last call."""


@runtime_checkable
class Reclaimable(Protocol):
    """A vehicle that a pilot or its own failsafe may take over."""

    def reclaim(self, now: Time) -> None:
        """Request control of the vehicle; a refusal appears in `override.refused`."""


@runtime_checkable
class ShowsTruth(Protocol):
    """A link to a simulator that knows where the vehicle is."""

    def truth(self) -> Truth | None:
        """Return the true state for the recorder and the expectations; None if unknown."""


@runtime_checkable
class ShowsView(Protocol):
    """A link to a simulator in which a fault can exchange the cameras of two vehicles."""

    def view(self) -> Truth | None:
        """Return the true state of the vehicle from which this one's cameras see."""


@runtime_checkable
class SimulatesLab(Protocol):
    """A link to a simulator that may model the imperfections of a lab. is_calm: it models none."""

    is_calm: bool


class Touch(NamedTuple):
    """A vehicle begins to touch something. carries: whether that pushes it upward, as ground
    does."""

    into: str
    carries: bool


@runtime_checkable
class ReportsTouches(Protocol):
    """A link to a simulator that knows what its vehicle touches."""

    def report_touches(self, tell: Callable[[Touch], None]) -> None:
        """Call `tell` with each touch from now on, in the tick in which it begins."""


def truth_source(link: Link) -> Callable[[], Truth | None]:
    """Return a function that returns the vehicle's true state, always None without a simulator."""
    return link.truth if isinstance(link, ShowsTruth) else _unknown


def view_source(link: Link) -> Callable[[], Truth | None]:
    """Return a function that returns the true state of the vehicle from which a simulated camera
    sees: its own, or another while a fault has exchanged them."""
    return link.view if isinstance(link, ShowsView) else truth_source(link)


def is_calm(link: Link) -> bool:
    """Return whether the vehicle's world has no imperfections, as without a simulator."""
    return link.is_calm if isinstance(link, SimulatesLab) else True


def _unknown() -> None:
    return None
