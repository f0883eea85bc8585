"""A vehicle's link: what the engine reads and sends once a tick, and what a link may do beside.

A link must `read` and `send`. Whatever else it can do it shows by its type: it has the method of
one of the small protocols below, and the runtime finds that with `isinstance`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol, runtime_checkable

from kybflow.core.signals import Command, Estimate, Measurement, MeasurementKind, Time, Truth
from kybflow.parts.fault import Rig


class Check(NamedTuple):
    """A line of the preflight that the vehicle itself answers: what was checked, whether it passed,
    and what was found, in words that say what to change (they may carry a table, `details`).
    waits: whether it may still pass without anybody's doing."""

    name: str
    green: bool
    reason: str
    waits: bool = True


class StatusText(NamedTuple):
    """What the vehicle says of itself, in its own words. severity: `critical`, `error`, `warning`,
    or `notice` and less."""

    severity: str
    text: str


class Override(NamedTuple):
    """Why a vehicle whose link works doesn't follow commands. lands: its own failsafe has it, not a
    person, and it must be landed. refused: why it wasn't given back when somebody asked for it;
    empty while nobody has asked and while the answer is awaited."""

    reason: str
    lands: bool = False
    refused: str = ""


class Link(ABC):
    """One vehicle's connection.

    rig: what faults break in a simulated vehicle; None on hardware.
    override: why the vehicle doesn't follow commands though its link works, because a pilot flies
    it or it changed its mode by itself; None while it follows. The link then sends no command until
    somebody asks for the vehicle back (`Reclaimable`).
    armed: whether the rotors may turn, as the vehicle says; None where it says nothing.
    is_heard: whether the last `read` brought something from the vehicle itself, and not only what a
    simulator gives beside it.
    """

    rig: Rig | None = None
    override: Override | None = None
    armed: bool | None = None
    is_heard: bool = True

    @abstractmethod
    def read(self, now: Time) -> Sequence[Measurement]:
        """Return the measurements that arrived since the last call, oldest first. A measurement
        more than 5 ms later than `now` is discarded and reported. Raises DriverError."""

    @abstractmethod
    def send(self, command: Command, now: Time) -> None:
        """Hand over the newest command. Raises DriverError."""


@runtime_checkable
class Subscribable(Protocol):
    """A link that delivers some kinds of measurement only on demand."""

    def subscribe(self, kinds: frozenset[MeasurementKind]) -> None:
        """From now on deliver at least these kinds, where the driver provides them."""


@runtime_checkable
class Arms(Protocol):
    """A vehicle that must be armed before it follows commands."""

    def arm(self, command: Command, now: Time) -> bool:
        """Get ready to follow; return whether the rotors turn and commands are followed. Called
        once a tick in place of `send`, from the first armed command until it returns True; the
        behavior's time stands still meanwhile. command: what is asked of the vehicle then. Raises
        Refused with the vehicle's own words; DriverError."""


@runtime_checkable
class StopsRotors(Protocol):
    """A vehicle whose rotors can be stopped in the air."""

    def cut(self, now: Time) -> None:
        """Stop the rotors at once. Called in the tick in which they must stop; disarmed commands
        follow."""


@runtime_checkable
class Lands(Protocol):
    """A vehicle with a land mode of its own."""

    def land(self, now: Time) -> bool:
        """Land by the vehicle's own land mode; return whether it is on the ground with its rotors
        at rest. Called once a tick in place of `send` while the failsafe lands a vehicle whose
        driver `lands`: the first call starts the mode, the next `send` ends it. Raises Refused with
        the vehicle's own words when it won't land, or no longer does; DriverError."""


@runtime_checkable
class Grips(Protocol):
    """A vehicle with a servo that holds a payload."""

    def grip(self, is_open: bool, now: Time) -> None:
        """Open or close the servo on the channel that the vehicle's context names. Called every
        tick until a Payload measurement acknowledges it, so that nothing is lost on a bad link; the
        link repeats the request as often as its protocol wants. Raises Refused with the vehicle's
        own words; DriverError."""


@runtime_checkable
class TakesPosition(Protocol):
    """A vehicle that fuses its position from outside, such as an autopilot without GPS."""

    def tell_position(self, estimate: Estimate, now: Time) -> None:
        """Tell the vehicle where it is; called once a tick while that is known."""


@runtime_checkable
class ReportsChecks(Protocol):
    """A vehicle that answers preflight checks itself."""

    def checks(self, now: Time) -> Sequence[Check]:
        """Return the vehicle's own preflight checks; called once a tick until all have passed."""


@runtime_checkable
class SendsStatusTexts(Protocol):
    """A vehicle that reports its state in words."""

    def status_texts(self) -> Sequence[StatusText]:
        """Return what the vehicle said since the last call, oldest first, each text once."""


@runtime_checkable
class Reclaimable(Protocol):
    """A vehicle that a pilot or its own failsafe may take over, and that can be asked for back."""

    def reclaim(self, now: Time) -> None:
        """Ask for the vehicle back; one that isn't given back says why in `override.refused`."""


@runtime_checkable
class ShowsTruth(Protocol):
    """A link to a simulator that knows where the vehicle is."""

    def truth(self) -> Truth | None:
        """Return the true state for the recorder and the expectations; None where unknown."""


@runtime_checkable
class ShowsView(Protocol):
    """A link to a simulator in which cameras can be exchanged between vehicles."""

    def view(self) -> Truth | None:
        """Return the true state of the vehicle whose camera this one sees through."""


@runtime_checkable
class ReportsCollisions(Protocol):
    """A link to a simulator that notices collisions."""

    def collisions(self) -> Sequence[str]:
        """Return what the vehicle ran into in the air since the last call; for the recorder and the
        expectations."""


def truth_source(link: Link) -> Callable[[], Truth | None]:
    """Return what tells the true state of a vehicle: None wherever no simulator does."""
    return link.truth if isinstance(link, ShowsTruth) else _unknown


def view_source(link: Link) -> Callable[[], Truth | None]:
    """Return what tells from where a simulated camera sees: the vehicle's true state, or another's
    where a fault has exchanged their cameras."""
    return link.view if isinstance(link, ShowsView) else truth_source(link)


def _unknown() -> None:
    return None
