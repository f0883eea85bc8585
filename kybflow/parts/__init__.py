"""The base class of each kind of part, and the values that parts exchange with the engine.

A part is one file with a docstring, its `@params` and its class; the file's name is its name in
YAML. Parts are passive: none sleeps, starts a thread, prints, reads a clock or uses a global random
generator. The engine replaces `self.params` between ticks when an option changes, so read it in
every update.
"""

from kybflow.core.params import Field, fields_of, param, params
from kybflow.parts.action import Action, ActionContext
from kybflow.parts.base import Claim, Objection, Part
from kybflow.parts.behavior import (
    AIR,
    GROUND,
    MOVING,
    Behavior,
    Entry,
    Flight,
    Footprint,
    Leg,
    Origin,
)
from kybflow.parts.control_loop import Estimator, Processor, Supervisor, Tracker
from kybflow.parts.coordinator import Coordinator, Shares, Team, TeamMember, TeamTick
from kybflow.parts.driver import Act, Air, Charge, Driver, MeasuredPositions, Seat, Session
from kybflow.parts.fault import ActiveFaults, Effect, Fault, Filter
from kybflow.parts.input import AXES, Input, InputLink
from kybflow.parts.link import Check, ForeignCommand, Link, Override, StatusText
from kybflow.parts.sensor import Sensor, Stream

__all__ = [
    "AIR",
    "AXES",
    "GROUND",
    "MOVING",
    "Act",
    "Action",
    "ActionContext",
    "ActiveFaults",
    "Air",
    "Behavior",
    "Charge",
    "Check",
    "Claim",
    "Coordinator",
    "Driver",
    "Effect",
    "Entry",
    "Estimator",
    "Fault",
    "Field",
    "Filter",
    "Flight",
    "Footprint",
    "ForeignCommand",
    "Input",
    "InputLink",
    "Leg",
    "Link",
    "MeasuredPositions",
    "Objection",
    "Origin",
    "Override",
    "Part",
    "Processor",
    "Seat",
    "Sensor",
    "Session",
    "Shares",
    "StatusText",
    "Stream",
    "Supervisor",
    "Team",
    "TeamMember",
    "TeamTick",
    "Tracker",
    "fields_of",
    "param",
    "params",
]  # fmt: skip
