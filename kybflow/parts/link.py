"""The link to a vehicle: once a tick, the engine reads measurements from it and sends it a command.

Every link can `read` and `send`. It offers each further capability by implementing one of the
protocols below, which the runtime detects with `isinstance`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple, Protocol, runtime_checkable

from kybflow.core.geometry import Vec3
from kybflow.core.signals import Command, Estimate, Measurement, MeasurementKind, Time, Truth
from kybflow.parts.fault import ActiveFaults
from kybflow.world.objects import ObjectState

if TYPE_CHECKING:
    import random


class Check(NamedTuple):
    """A preflight check made by the vehicle itself. name: its name. green: whether it passed.
    reason: what was found and must change, optionally with a table (`kybflow.core.text`). waits:
    whether it may still pass without intervention."""

    name: str
    green: bool
    reason: str
    waits: bool = True


class StatusText(NamedTuple):
    """A text message from the vehicle. severity: `critical`, `error`, `warning`, or a lower one
    such as `notice`."""

    severity: str
    text: str


class ForeignCommand(NamedTuple):
    """A command that another program or person gave a vehicle. reason: a description of it.
    allowed: whether the run may still succeed."""

    reason: str
    allowed: bool


class Override(NamedTuple):
    """Why a vehicle with a working link doesn't follow commands. lands: its own failsafe, not a
    person, controls it, and it must land. refused: why a request for control was refused; empty if
    none was made or answered yet."""

    reason: str
    lands: bool = False
    refused: str = ""


class Link(ABC):
    """The connection to one vehicle.

    faults: the faults that act on a simulated vehicle or on our side of its link; None on hardware.
    override: why the vehicle doesn't follow commands (a pilot flies it, or it changed its mode by
    itself); None while it follows them. While overridden, the link sends no command until the
    operator requests control (`Reclaimable`). armed: whether the vehicle reports that it is armed;
    None if it reports nothing. is_heard: whether the last `read` received data from the vehicle
    itself, not only from a simulator beside it. delay: round-trip time to the vehicle in seconds:
    the shorter of the newest two, so that a single slow one doesn't count; zero while unknown.
    rejection: why the vehicle doesn't use the positions that it is sent (`TakesPosition`); None if
    it does, or takes none.
    """

    faults: ActiveFaults | None = None
    override: Override | None = None
    armed: bool | None = None
    is_heard: bool = True
    delay: float = 0.0
    rejection: str | None = None

    @abstractmethod
    def read(self, now: Time) -> Sequence[Measurement]:
        """Return the measurements that arrived since the last call, oldest first. A measurement
        whose time is more than 5 ms after `now` is discarded and reported. Raises DriverError."""

    @abstractmethod
    def send(self, command: Command, now: Time) -> None:
        """Send the newest command. Raises DriverError."""


@runtime_checkable
class Subscribable(Protocol):
    """A link that delivers some kinds of measurement only on demand."""

    def subscribe(self, kinds: frozenset[MeasurementKind]) -> None:
        """From now on, deliver at least these kinds of measurement, if the driver provides them."""


@runtime_checkable
class Arms(Protocol):
    """A vehicle that must be armed before it follows commands."""

    def arm(self, command: Command, now: Time) -> bool:
        """Arm the vehicle. Return whether the rotors turn and the vehicle follows commands. Called
        once a tick instead of `send`, from the first armed command until it returns True; the
        behavior's time is frozen meanwhile. command: the behavior's current command. Raises Refused
        with the vehicle's own message, or DriverError."""


@runtime_checkable
class StopsRotors(Protocol):
    """A vehicle whose rotors can be stopped in the air."""

    def cut(self, now: Time) -> None:
        """Stop the rotors at once, in flight. The commands that follow are disarmed ones."""


@runtime_checkable
class DisarmsByForce(Protocol):
    """A vehicle that may refuse to disarm on the ground, and can be disarmed by force."""

    def disarm_by_force(self, now: Time) -> None:
        """Disarm by force a vehicle that stands on the ground and ignored the normal command.
        Raises Refused if the vehicle reports that it is flying."""


@runtime_checkable
class Lands(Protocol):
    """A vehicle that has a land mode of its own."""

    def land(self, now: Time) -> bool:
        """Land in the vehicle's own land mode. Return whether it is on the ground with its rotors
        at rest. Called once a tick instead of `send` while the failsafe lands a vehicle whose
        driver `lands`: the first call starts the mode, the next `send` ends it. Raises Refused with
        the vehicle's own message if it refuses or stops landing, or DriverError."""


@runtime_checkable
class Grips(Protocol):
    """A vehicle with a servo that holds a payload."""

    def grip(self, is_open: bool, now: Time) -> None:
        """Open or close the servo on the channel given in the vehicle's context. Called every tick
        until a Payload measurement acknowledges the request, so that a bad link loses nothing; the
        link repeats the request as its protocol requires. Raises Refused with the vehicle's own
        message, or DriverError."""


@runtime_checkable
class Performs(Protocol):
    """A vehicle that performs the driver's `acts`."""

    def perform(self, act: str, now: Time) -> None:
        """Request one of the driver's `acts`, once. Raises Refused with the reason if it is
        impossible now, or DriverError."""


@runtime_checkable
class TakesPosition(Protocol):
    """A vehicle that fuses a position sent to it, such as an autopilot without GPS."""

    def tell_position(self, estimate: Estimate, now: Time) -> None:
        """Send the vehicle its position. Called once a tick while the position is known."""


@runtime_checkable
class ReportsChecks(Protocol):
    """A vehicle that makes preflight checks of its own."""

    def checks(self, now: Time) -> Sequence[Check]:
        """Return the vehicle's own preflight checks, without sending anything. Called once a tick
        until all have passed."""


@runtime_checkable
class PreparesPreflight(Protocol):
    """A vehicle that must be sent something before its preflight checks can pass, such as a change
    of mode."""

    def prepare_preflight(self, now: Time) -> None:
        """Send what the vehicle's checks still need. The vehicle stays disarmed. Called once a tick
        before `checks`, until all have passed. Raises DriverError."""


@runtime_checkable
class SendsStatusTexts(Protocol):
    """A vehicle that sends text messages."""

    def status_texts(self) -> Sequence[StatusText]:
        """Return the messages that arrived since the last call, oldest first."""


@runtime_checkable
class NoticesOthers(Protocol):
    """A vehicle that other programs or people may command too."""

    def foreign_commands(self) -> Sequence[ForeignCommand]:
        """Return the commands of others that were noticed since the last call."""


@runtime_checkable
class Reclaimable(Protocol):
    """A vehicle that a pilot or its own failsafe may take over."""

    def reclaim(self, now: Time) -> None:
        """Request control of the vehicle; a refusal appears in `override.refused`."""


@runtime_checkable
class ShowsTruth(Protocol):
    """A link to a simulator that knows the vehicle's true state."""

    def truth(self) -> Truth | None:
        """Return the true state for the recorder and the expectations; None if unknown."""


@runtime_checkable
class ShowsView(Protocol):
    """A link to a simulator in which a fault can swap the cameras of two vehicles."""

    def view(self) -> Truth | None:
        """Return the true state of the vehicle from which this vehicle's cameras see."""


@runtime_checkable
class SimulatesLab(Protocol):
    """A link to a simulator that may model the imperfections of a lab. is_calm: whether it models
    none."""

    is_calm: bool


@runtime_checkable
class Carriable(Protocol):
    """A link to a simulator in which a hand can move the vehicle."""

    def carry(self, way: Vec3, turn: Vec3, generator: random.Random) -> None:
        """Let a simulated hand, clumsy as a person's, move the vehicle by about `way` (m, world
        frame), turn it by about `turn` (rotation vector, rad, body frame), and hold it there. The
        first call grasps the vehicle; `generator` then makes all randomness of the hand."""


class Touch(NamedTuple):
    """The beginning of a contact between a vehicle and something else. into: what the vehicle
    touches. carries: whether the contact pushes the vehicle upward, as the ground does."""

    into: str
    carries: bool


@runtime_checkable
class ReportsTouches(Protocol):
    """A link to a simulator that detects the contacts of its vehicle."""

    def report_touches(self, tell: Callable[[Touch], None]) -> None:
        """From now on, call `tell` with each contact, in the tick in which it begins."""


class Contact(NamedTuple):
    """What a vehicle presses: a surface of an object, empty for its box."""

    vehicle: str
    object: str
    surface: str


class SimulatedScene(Protocol):
    """The objects of a simulator, which move."""

    def states(self) -> Mapping[str, ObjectState]:
        """Return the true state of every object, by name."""

    def contacts(self) -> Mapping[Contact, float]:
        """Return the force (N) of every contact of a vehicle with an object."""

    def faults(self) -> Mapping[str, ActiveFaults]:
        """Return the faults of every object that can have some, by name."""


def truth_source(link: Link) -> Callable[[], Truth | None]:
    """Return a function that returns the vehicle's true state, or always None if there is no
    simulator."""
    return link.truth if isinstance(link, ShowsTruth) else lambda: None


def view_source(link: Link) -> Callable[[], Truth | None]:
    """Return a function that returns the true state of the vehicle from which a simulated camera
    sees: the camera's own vehicle, or another one while a fault has swapped them."""
    return link.view if isinstance(link, ShowsView) else truth_source(link)


def is_calm(link: Link) -> bool:
    """Return whether the vehicle's world models no imperfections; True if there is no simulator."""
    return link.is_calm if isinstance(link, SimulatesLab) else True
