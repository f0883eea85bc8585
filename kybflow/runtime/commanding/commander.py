"""Executes a person's commands at the start of a tick, and answers them.

Each command is answered once, with the reason if it is refused. Most commands are answered at once;
commands that a vehicle decides on are answered when the vehicle acts, in the same tick or the next.
Answered commands are emitted as the event `command_given`, in the order in which they arrived, so
that the run can be flown again. A command to all vehicles is also emitted as the operator's event
(such as `operator.pause`), for which the mission may wait.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from functools import partial

from kybflow.core.errors import KybflowError, Refused, described
from kybflow.core.events import Custom
from kybflow.core.signals import NS, Time
from kybflow.core.text import did_you_mean
from kybflow.dsl.plan import Emit, Enable, EnterPhase, Perform, SetOption, Stop, Switch
from kybflow.parts.events import ClientsRefusedEvent, CommandGiven, CommandsFailed, LeaseTaken
from kybflow.parts.observables import is_in
from kybflow.runtime.commanding.command_queue import (
    OVER,
    ClientDisconnected,
    ClientsRefused,
    CommandQueue,
    GivenCommand,
    Question,
    ServerFailure,
)
from kybflow.runtime.commanding.legal import NOT_FLYING, RunView, check_emitted
from kybflow.runtime.commanding.orders import (
    PREFIX,
    Answer,
    LandOrder,
    Lease,
    PauseOrder,
    ReleaseLease,
    ResetOrder,
    ResumeOrder,
    TrackOrder,
    VehicleOrder,
    text,
    word,
)
from kybflow.runtime.commanding.situation import Situation
from kybflow.runtime.fleet.callbacks import RunControls
from kybflow.runtime.vehicle.requests import Requester, Requests

BY = "operator"
"""The name of the requester in events."""
LANDED = "a person landed it, and it stays on the ground"

_Answered = Callable[[Answer], None]


class Commander:
    """Executes the commands in a queue. give_up: ends all flows; is called when a person lands
    every vehicle."""

    def __init__(
        self,
        watched: RunView,
        controls: RunControls,
        give_up: Callable[[], None],
        queue: CommandQueue,
    ) -> None:
        self._watched, self._controls, self._give_up = watched, controls, give_up
        self._plan, self._events = watched.plan, controls.events
        self._queue, self._lease = queue, Lease()
        self._scheduled, self._waiting = queue.scheduled, queue.waiting
        self._heard: deque[_Heard] = deque()

    def step(self, now: Time) -> None:
        """Execute the scheduled commands that are due and the waiting ones. The engine calls this
        at the start of a tick."""
        while self._scheduled and self._scheduled[0][0] <= now:
            self._hear(self._scheduled.popleft()[1], now, flying=True)
        if self._waiting:
            self._take_up(now, flying=True)

    def stand_by(self, now: Time) -> None:
        """Answer the waiting commands during the preflight, in which a person can only stop the run
        or release the lease."""
        due = [item for item in self._scheduled if item[0] <= now and not item[1].name]
        for item in due:
            self._scheduled.remove(item)
            self._hear(item[1], now, flying=False)
        if self._waiting:
            self._take_up(now, flying=False)

    def close(self) -> None:
        """Answer the commands that no vehicle has answered, because the run is over, and report the
        last refused clients."""
        for untold in self._queue.last_words:
            if reason := untold():
                self._events.emit(ClientsRefusedEvent(reason=reason))
        while self._heard:
            self._answer(self._heard[0], Answer(False, OVER))

    def situation(self, now: Time, *, flying: bool = True) -> Situation:
        """Return the situation of the run at the end of the last tick."""
        return self._watched.situation(now, self._lease.holder, flying=flying)

    def _take_up(self, now: Time, *, flying: bool) -> None:
        situation: Situation | None = None
        for _ in range(len(self._waiting)):
            match self._waiting.popleft():
                case GivenCommand() as given:
                    self._hear(given, now, flying=flying)
                case Question(shown):
                    situation = situation or self.situation(now, flying=flying)
                    shown(situation)
                case ClientDisconnected(by):
                    if by == self._lease.holder:
                        self._hear(GivenCommand(ReleaseLease(), by), now, flying=flying)
                case ServerFailure(reason):
                    self._events.emit(CommandsFailed(reason=reason))
                case ClientsRefused(reason):
                    self._events.emit(ClientsRefusedEvent(reason=reason))

    def _hear(self, given: GivenCommand, now: Time, *, flying: bool) -> None:
        heard = _Heard(given, now)
        self._heard.append(heard)
        answered = partial(self._answer, heard)
        before, order = self._lease.holder, given.order
        reason = self._lease.objection(order, given.by, given.take)
        if reason is None and before not in (None, given.by, self._lease.holder):
            self._events.emit(LeaseTaken(by=given.by, previous=before))
        if reason is None and not flying and not isinstance(order, (Stop, ReleaseLease)):
            reason = NOT_FLYING
        if reason is not None:
            answered(Answer(False, reason))
            return
        try:
            self._give(given, answered)
        except KybflowError as refusal:
            answered(Answer(False, str(refusal)))
        except Exception as error:  # a command must not stop the flight
            answered(Answer(False, described(error)))

    def _answer(self, heard: _Heard, answer: Answer) -> None:
        """Record a command's answer, and publish the answers that are due in the order of their
        commands."""
        heard.answer = heard.answer or answer
        while self._heard and self._heard[0].answer is not None:
            first = self._heard.popleft()
            assert first.answer is not None
            self._events.emit(first.record(first.answer, self._events.now))
            first.given.answered(first.answer)

    def _give(self, given: GivenCommand, answered: _Answered) -> None:
        controls = self._controls
        match given.order:
            case Emit(name):
                check_emitted(self._plan, (name,))
                waits = name in self._watched.awaited_now()
                self._events.emit(Custom(name))
                answered(Answer(True, "" if waits else "nothing waits for it now"))
            case Switch(vehicle, state, written):
                requests, goal = self._requests(vehicle), self._goal(vehicle, state)
                values, said = requests.read(goal, written), _as_answer(answered)
                requests.switch(goal, Requester.OPERATOR, answered=said, values=values)
            case SetOption(option, value):
                controls.options.set(option, value, BY, answered=_as_answer(answered))
            case Enable(vehicle, label, on):
                self._requests(vehicle).enable(label, on, BY, answered=_as_answer(answered))
            case EnterPhase(flow, phase):
                self._check_phase(flow, phase)
                _as_answer(answered)(controls.phase(flow, phase, BY, ""))
            case Perform(vehicle, act):
                self._requests(vehicle).perform(act, BY, answered=_as_answer(answered))
            case Stop(reason):
                self._events.emit(Custom(f"{PREFIX}stop"))
                controls.stop(reason or "stopped by the operator", "")
                answered(Answer(True))
            case ReleaseLease():
                answered(Answer(True))
            case TrackOrder(vehicle, point):
                _as_answer(answered)(self._requests(vehicle).track(point))
            case order:
                self._ask_vehicles(order, answered)

    def _ask_vehicles(self, order: VehicleOrder, answered: _Answered) -> None:
        """Make a request to each vehicle that the command names. A command to all vehicles is also
        emitted as an event."""
        everyone = self._controls.requests
        asked = {name: self._requests(name) for name in order.vehicles or everyone}
        if len(asked) == len(everyone):
            event = f"{PREFIX}{word(order)}"
            waits = event in self._watched.awaited_now()
            self._events.emit(Custom(event))
            if isinstance(order, LandOrder) and any(
                requests.land_objection() is None for requests in asked.values()
            ):
                self._give_up()
        else:
            waits = False
        poll = _Poll(tuple(asked), answered, is_heard=waits)
        for name, requests in asked.items():
            said = partial(poll.said, name)
            match order:
                case PauseOrder():
                    requests.pause(BY, answered=said)
                case ResumeOrder():
                    requests.resume(BY, answered=said)
                case ResetOrder():
                    requests.reset(BY, answered=said)
                case LandOrder():
                    said(_landed(requests))

    def _requests(self, vehicle: str) -> Requests:
        """Return the requests of a vehicle. Raises Refused if there is no such vehicle."""
        known = self._controls.requests
        if vehicle not in known:
            raise Refused(f"there is no vehicle `{vehicle}`; {did_you_mean(vehicle, known)}")
        return known[vehicle]

    def _goal(self, vehicle: str, name: str) -> str:
        """Return the name of the requested state; a chain's name stands for its first state. Raises
        Refused if there is neither."""
        [plan] = (plan for plan in self._plan.vehicles if plan.name == vehicle)
        if name in plan.states:
            return name
        for state in plan.states:
            if is_in(state, name):
                return state
        hint = did_you_mean(name, plan.states)
        raise Refused(f"`{vehicle}` has no state `{name}`; {hint}")

    def _check_phase(self, flow: str, phase: str) -> None:
        """Raise Refused if the mission doesn't have this flow or phase."""
        flows = {plan.name: plan.phases for plan in self._plan.flows}
        if flow not in flows:
            raise Refused(f"there is no flow `{flow}`; {did_you_mean(flow, flows)}")
        if phase not in flows[flow]:
            raise Refused(f"`{flow}` has no phase `{phase}`; {did_you_mean(phase, flows[flow])}")


class _Heard:
    """A command that arrived, and its answer once there is one."""

    __slots__ = ("answer", "at", "given")

    def __init__(self, given: GivenCommand, at: Time) -> None:
        self.given, self.at = given, at
        self.answer: Answer | None = None

    def record(self, answer: Answer, now: Time) -> CommandGiven:
        """Return the event that reports the command and its answer."""
        return CommandGiven(
            command=text(self.given.order),
            by=self.given.by,
            take=self.given.take,
            heard_s=None if self.at == now else self.at / NS,
            accepted=answer.accepted,
            reason=answer.reason,
        )


class _Poll:
    """Combines the answers of several vehicles into one. The command is accepted if any vehicle
    accepts it, or if the mission waits for it as an event. The answer names the vehicles that
    refuse."""

    def __init__(self, asked: Sequence[str], decided: _Answered, *, is_heard: bool) -> None:
        self._silent, self._decided = len(asked), decided
        self._asked, self._is_heard = asked, is_heard
        self._refusals: list[str] = []

    def said(self, vehicle: str, reason: str | None) -> None:
        self._silent -= 1
        if reason is not None:
            self._refusals.append(f"{vehicle}: {reason}" if len(self._asked) > 1 else reason)
        if self._silent == 0:
            accepted = self._is_heard or len(self._refusals) < len(self._asked)
            self._decided(Answer(accepted, "; ".join(self._refusals)))


def _as_answer(answered: _Answered) -> Callable[[str | None], None]:
    return lambda reason: answered(Answer(reason is None, reason or ""))


def _landed(requests: Requests) -> str | None:
    """Land a vehicle; return why that is refused or failed, or None."""
    try:
        reason = requests.land_objection()
        if reason is None:
            requests.retire(LANDED)
    except Exception as error:  # a part may raise anything; the others land all the same
        return described(error)
    return reason
