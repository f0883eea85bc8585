"""The differences between autopilot firmwares, as data and small functions.

Each module of this package is one firmware. Its file name is the name used in YAML and on the
command line, and its `PROFILE` is a `FirmwareProfile`. Adding a file adds a firmware: its targets,
the choices of commands, the schema and the reference follow. Nothing here needs pymavlink, because
the compiler reads profiles too."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from importlib import import_module
from math import isfinite
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, Literal, NamedTuple

from kybflow.core.errors import DriverError
from kybflow.drivers import firmware_names

if TYPE_CHECKING:
    from kybflow.drivers.mavlink.protocol.framing import Message
    from kybflow.drivers.mavlink.telemetry.received_status import ReceivedStatus

OWN: Final = "own"
"""Used as a parameter's value: stands for this program's system id."""
DO_SET_RELAY, DO_SET_SERVO, DO_SET_ACTUATOR, DO_GRIPPER = 181, 183, 187, 211
RELEASE, GRAB = 0.0, 1.0
"""Values of GRIPPER_ACTIONS."""


class Needed(NamedTuple):
    """A parameter that flight indoors needs.

    value: the value to write; `OWN` stands for this program's system id.
    why: the effect of that value, in one plain line.
    allowed: other acceptable values, with their effects.
    rule: `equal` accepts the value and the allowed ones; `at_most` accepts what is above zero and
    not above the value; `bits` accepts any value that has these bits set.
    simulator_only: whether only the firmware's own simulator has the parameter.
    restart: whether the value takes effect only after a restart.
    """

    name: str
    value: float | Literal["own"]
    why: str
    allowed: Mapping[int, str] = MappingProxyType({})
    rule: Literal["equal", "at_most", "bits"] = "equal"
    simulator_only: bool = False
    restart: bool = False

    def wanted(self, own: int, found: float = 0.0) -> float:
        """Return the value to write. own: this program's system id. found: the value found."""
        if self.value == OWN:
            return float(own)
        if self.rule == "bits" and isfinite(found):
            return float(int(found) | int(self.value))
        return float(self.value)

    def does(self, found: float) -> str:
        """Return the effect of the value found if it is an allowed one, otherwise that of the value
        to write."""
        return self.allowed.get(round(found), self.why) if isfinite(found) else self.why

    def accepts(self, found: float, own: int) -> bool:
        """Return whether the value found is acceptable, to the precision of a float32."""
        wanted = self.wanted(own, found)
        if self.rule == "at_most":
            return 0.0 < found <= wanted + 1e-6
        return any(abs(found - good) <= 1e-6 * max(1.0, good) for good in (wanted, *self.allowed))


class Latency(NamedTuple):
    """The delay with which a vehicle follows its setpoints, seconds: `position` for setpoints with
    a position or velocity, `acceleration` for those with an acceleration alone."""

    position: float
    acceleration: float


class Danger(NamedTuple):
    """A parameter that makes a vehicle dangerous if this program or the link fails.

    values: the dangerous values, with what would happen.
    cure: what to set instead, except for `others`.
    above: larger values are dangerous as well.
    excess: what would happen with such a value.
    others: what would happen with any value but this program's system id, if that is dangerous.
    indoors: whether the value is dangerous only if the position comes from outside.
    """

    name: str
    values: Mapping[int, str] = MappingProxyType({})
    cure: str = ""
    above: float | None = None
    excess: str = ""
    others: str = ""
    indoors: bool = False

    def of(self, found: float, own: int) -> str | None:
        """Return the preflight's text about the value found; None if it is not dangerous."""
        if not isfinite(found):
            return f"{self.name} is {found:g}, which is not a valid value; set {self.cure or own}"
        said, cure = self.values.get(round(found)), self.cure
        if self.above is not None and found > self.above + 1e-6:
            said = self.excess
        if self.others and round(found) != own:
            said, cure = self.others, f"{own} (this program)"
        return None if said is None else f"{self.name} is {found:g}: {said}; set {cure}"


class PayloadCommand(NamedTuple):
    """A COMMAND_LONG that opens or closes an output. command: its MAV_CMD. params: its first
    parameters. seen: whether its effect shows in SERVO_OUTPUT_RAW; otherwise only its
    acknowledgement is known."""

    command: int
    params: tuple[float, ...]
    seen: bool = True


class Output(NamedTuple):
    """An auxiliary output. number: its number among all outputs of the autopilot. parameter: the
    parameter that sets its function. shown: whether SERVO_OUTPUT_RAW reports its pulses."""

    number: int
    parameter: str
    shown: bool = True


@dataclass(frozen=True, kw_only=True)
class FirmwareProfile:
    """One kind of autopilot.

    mav_autopilot: its MAV_AUTOPILOT.
    names: the firmware's names of its modes, by custom_mode.
    modes: custom_mode by those names and by ours: `offboard` (follows setpoints), `land`, `hold`.
    manual_modes: the names of the modes that a person flies.
    streams: the messages that can be requested from it.
    polled: those streams whose rate can't be set, so that every message is requested separately.
    indoors: the parameters that flight without GPS needs.
    dangers: the parameters that can be dangerous.
    renamed: parameter names in other firmware versions, by the names used here.
    streams_first: whether setpoints must be sent before it accepts `offboard`.
    climbs: whether it leaves the ground only by its own take-off.
    needs_descent: whether it detects a landing only if a downward velocity or a thrust is
        commanded, not with accelerations, and its land mode lifts a vehicle on the ground at first.
    needs_origin: whether it needs a geographic position before it has a position.
    raises: whether it raises the thrust with the tilt itself.
    integer_parameters_bytewise: whether the bytes of an integer are sent in the float field.
    hover_parameter: the parameter that holds its hover throttle.
    reaction: the parameter that sets its reaction when this program fails.
    feeds: the parameters that select kybflow as the source of its position.
    feeds_own: the parameters that select a source of its own.
    takeoff_height: the height of a take-off, metres.
    latency: how late it follows its setpoints.
    attitude_gain: the default gain of its attitude loop, 1/s.
    gyro_filter: the cut-off frequency of its rate loop's filter, Hz.
    keeps_height: whether it holds the height that it integrates from commanded accelerations.
    sphere: the radius of the earth in its simulator, metres; None if it uses the ellipsoid.
    mode_params: the first three parameters of DO_SET_MODE for a custom_mode.
    default_address: the address of its simulator, by system id.
    output: the n-th auxiliary output, from 1, of the simulator or of hardware.
    grip: the commands that open or close the payload on an output, the likeliest first, none if
        nothing can be moved; takes the output's number, whether to open, and the value of the
        output's parameter, None while unknown.
    ready: why it can't be armed yet in its current mode; None if it can.
    spread: the standard deviation of its position, metres, from a message of its estimator's
        status; None while it has no position.
    battery_acts_at: the state of the battery (MAV_BATTERY_CHARGE_STATE) at which its own failsafe
        acts, if enabled: 2 is low, 3 critical.
    """

    mav_autopilot: int
    names: Mapping[int, str]
    modes: Mapping[str, int]
    manual_modes: frozenset[str]
    streams: frozenset[str]
    polled: frozenset[str]
    indoors: tuple[Needed, ...]
    dangers: tuple[Danger, ...]
    renamed: Mapping[str, str]
    streams_first: bool
    climbs: bool
    needs_descent: bool
    needs_origin: bool
    raises: bool
    integer_parameters_bytewise: bool
    hover_parameter: str
    reaction: str
    feeds: tuple[str, ...]
    feeds_own: tuple[str, ...]
    takeoff_height: float
    latency: Latency
    attitude_gain: float
    gyro_filter: float
    keeps_height: bool
    sphere: float | None
    mode_params: Callable[[int], tuple[float, float, float]]
    default_address: Callable[[int], str]
    output: Callable[[int, bool], Output]
    grip: Callable[[int, bool, float | None], tuple[PayloadCommand, ...]]
    ready: Callable[[ReceivedStatus], str | None]
    spread: Callable[[Message], float | None]
    battery_acts_at: int
    name: str = ""

    def mode_name(self, custom_mode: int) -> str:
        """Return the firmware's name of a mode."""
        return self.names.get(custom_mode, f"mode {custom_mode}")

    def dangers_in(self, values: Mapping[str, float], own: int, *, indoors: bool) -> dict[str, str]:
        """Return the dangerous parameters among `values`, each with the preflight's text. own: this
        program's system id. indoors: whether the position comes from outside."""
        said = (
            (danger.name, danger.of(values[danger.name], own))
            for danger in self.dangers
            if danger.name in values and (indoors or not danger.indoors)
        )
        return {name: words for name, words in said if words is not None}


@cache
def profile_of(name: str) -> FirmwareProfile:
    """Return the profile of a firmware. Raises DriverError for an unknown name."""
    names = firmware_names("mavlink")
    if name not in names:
        raise DriverError(f"no autopilot {name!r}: there are {' and '.join(names)}")
    profile: FirmwareProfile = import_module(f"{__name__}.{name}").PROFILE
    return replace(profile, name=name)


def firmware_by(mav_autopilot: int | None) -> str | None:
    """Return the name of the firmware with this MAV_AUTOPILOT; None if kybflow doesn't support
    it."""
    profiles = map(profile_of, firmware_names("mavlink"))
    return next((p.name for p in profiles if p.mav_autopilot == mav_autopilot), None)


def named(names: Mapping[int, str], **ours: str) -> Mapping[str, int]:
    """Return the mode numbers by the firmware's own names and by kybflow's. ours: for each of
    kybflow's names the firmware's name of that mode."""
    own = {name: number for number, name in names.items()}
    return MappingProxyType(own | {our: own[name] for our, name in ours.items()})
