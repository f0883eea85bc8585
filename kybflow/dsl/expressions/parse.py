"""The parser of expressions: recursive descent with bounded depth.
`kybflow.dsl.expressions.semantics` decides what names and quantities mean, and whether they fit
together.

    expectation := 'finished' 'within' quantity | 'always' condition | 'finally' condition
                 | 'eventually' condition ['within' quantity] | statistic operator statistic
    condition   := both ('or' both)*
    both        := single ('and' single)*
    single      := 'not' single | '(' condition ')' | VEHICLE 'in' STATE
                 | ('all' | 'any') GROUP 'in' STATE | operand operator operand
    operand     := quantity | 'time' | observable | VEHICLE '.' observable | OBJECT '.' value
                 | INPUT '.' axis | word
                 | 'distance' '(' place 'to' place ')'
                 | 'separation' '(' 'all' | some ['and' some ...] ')'
                 | 'clearance' '(' VEHICLE ')'
                 | ('mean'|'max'|'min'|'rms') '(' operand ['in' [VEHICLE '.'] STATE] ')'
    some        := VEHICLE | GROUP | obstacle
    place       := VEHICLE | VEHICLE '.start' | 'start' | VEHICLE '.payload'
                 | 'world.points.' NAME | '[' x y z ']' | obstacle | OBJECT | OBJECT '.' SURFACE
    obstacle    := OBSTACLE | 'world.obstacles.' OBSTACLE
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, cast, get_args

from kybflow.core.text import nearest
from kybflow.core.units import DURATION, LENGTH, NUMBER, Dimension
from kybflow.dsl.diagnostics import PREFIX, Collector, Diagnostic, Text
from kybflow.dsl.expressions import tree
from kybflow.dsl.expressions.semantics import (
    HEALTH,
    Operand,
    Scope,
    Semantics,
    is_direction,
    is_quantity,
    of_each,
)
from kybflow.dsl.expressions.tokens import Cursor, Token, Unreadable
from kybflow.dsl.expressions.tree import shown_value
from kybflow.parts.observables import OBJECT_OBSERVABLES, OBSERVABLES

__all__ = ["Scope", "parse"]

CODES = {
    "KYB210": "The text is not an expression of the language.",
    "KYB211": "A name in an expression is unknown.",
    "KYB212": "The two sides of a comparison don't fit: another type or dimension, a missing "
    "unit, or a group instead of one vehicle.",
    "KYB213": "A form of expression is used where it isn't allowed.",
    "KYB214": "An expression is nested too deep or too long.",
    "KYB215": "A bound can't be reached: a share is from 0 % to 100 %, and a time is after the "
    "start.",
}
MAX_DEPTH = 32
MAX_LENGTH = 2000
_SPLIT = "remove superfluous parentheses, or split the condition"
EXPECTATIONS = ("always", "eventually", "finally", "finished")
FLIPPED: Mapping[tree.ComparisonOperator, tree.ComparisonOperator] = {
    "<": ">", "<=": ">=", ">": "<", ">=": "<=", "==": "==", "!=": "!=",
}  # fmt: skip
_QUANTIFIERS = frozenset(get_args(tree.Quantifier))
_FUNCTIONS = frozenset(get_args(tree.Function))
_NEXT = "`and`, `or` or the end"


class Parsed(NamedTuple):
    """The result of parsing a text. expression: None if there are errors. findings: the errors."""

    expression: tree.Expression | None
    findings: list[Diagnostic]


def parse(text: Text, scope: Scope) -> Parsed:
    """Parse `text`. Return the expression, or None with the findings. Never raises."""
    parsed: Parsed | None = scope.read.get(text)
    if parsed is not None:
        return parsed
    found, expression = Collector(), None
    if len(text.text) > MAX_LENGTH:
        message = f"this expression is longer than {MAX_LENGTH} characters"
        found.report("KYB214", message, text.span, f"{len(text.text)} characters", help=_SPLIT)
    else:
        try:
            expression = _Parser(text, scope, found).whole()
        except Unreadable:
            del found.all[:-1]  # the last one is the reason why parsing stopped
    parsed = scope.read[text] = Parsed(None if found.all else expression, found.all)
    return parsed


class _Parser:
    """Parses conditions and expectations. Statistics are allowed only in an expectation without
    `always`, `eventually` or `finally`."""

    def __init__(self, text: Text, scope: Scope, found: Collector) -> None:
        self._text, self._scope, self._found = text, scope, found
        self._tokens = Cursor(text, found)
        self._semantics = Semantics(text, scope, found)
        self._depth = 0
        self._may_have_statistics = self._has_statistics = False

    def whole(self) -> tree.Expression:
        expectation = self._scope.kind == "expectation"
        expression = self._expectation() if expectation else self._condition()
        if self._tokens.peek().kind != "end":
            raise self._tokens.unexpected(_NEXT)
        return expression

    def _expectation(self) -> tree.Expression:
        first, second = self._tokens.peek(), self._tokens.peek(1)
        if first.text in EXPECTATIONS:
            return self._timed(self._tokens.take().text)
        is_call = first.text in _FUNCTIONS and second.text == "("
        if not is_call and second.kind != "operator" and second.text != "in":
            near = nearest(first.text, EXPECTATIONS)
            if near:
                message = f"no expectation begins with `{first.text}`"
                raise self._tokens.stopped("KYB210", message, "unknown", f"did you mean `{near}`?")
        return self._statistic(first)

    def _timed(self, word: str) -> tree.Expression:
        if word == "finished":
            self._tokens.expect("within")
            return tree.Finished(self._limit())
        condition = self._condition()
        if word == "always":
            return tree.Always(condition)
        if word == "finally":
            return tree.Finally(condition)
        return tree.Eventually(condition, self._limit() if self._tokens.skip("within") else None)

    def _limit(self) -> float:
        """Parse a time after the start and return it in seconds; report KYB215 if it is not
        positive."""
        token, before = self._tokens.peek(), len(self._found.all)
        value = self._quantity(DURATION)
        if value <= 0.0 and len(self._found.all) == before:
            message = "nothing can happen before the run begins"
            hint = "write a time above 0 s, which counts from the start"
            self._semantics.report("KYB215", token, message, "no time left", hint)
        return value

    def _statistic(self, first: Token) -> tree.Condition:
        self._may_have_statistics = True
        condition = self._condition()
        match condition:
            case tree.Compare(_, tree.Aggregate(), tree.Aggregate() | tree.Quantity()):
                return condition
        if self._found.all:
            return condition
        if not self._has_statistics:
            message, label = "this expectation does not say when it should hold", "when?"
            hint = (
                "write `always`, `eventually` or `finally` before it, or `max(...)` around a value"
            )
        elif isinstance(condition, tree.Compare):
            is_left = isinstance(condition.left, tree.Aggregate)
            sides = (condition.left, condition.right)
            one, other = map(shown_value, sides if is_left else sides[::-1])
            message = f"`{one}` is one number for the whole run, but `{other}` changes during it"
            label, side = "", "right" if is_left else "left"
            hint = f"write `max({other})` or another statistic on the {side} side"
        else:
            message = "statistics can't be joined with `and`, `or` or `not`"
            label, hint = "joined here", "write each comparison on a line of its own"
        whole = first._replace(end=self._tokens.behind())
        self._semantics.report("KYB213", whole, message, label, hint)
        return condition

    def _condition(self) -> tree.Condition:
        parts = [self._both()]
        while self._tokens.skip("or"):
            parts.append(self._both())
        return parts[0] if len(parts) == 1 else tree.Or(tuple(parts))

    def _both(self) -> tree.Condition:
        parts = [self._single()]
        while self._tokens.skip("and"):
            parts.append(self._single())
        return parts[0] if len(parts) == 1 else tree.And(tuple(parts))

    def _single(self) -> tree.Condition:
        self._depth += 1
        if self._depth > MAX_DEPTH:
            message = f"this expression is nested more than {MAX_DEPTH} levels deep"
            raise self._tokens.stopped("KYB214", message, "one level too many", _SPLIT)
        try:
            first, second = self._tokens.peek(), self._tokens.peek(1)
            if first.text == "not":
                self._tokens.take()
                return tree.Not(self._single())
            if first.text == "(":
                self._tokens.take()
                inner = self._condition()
                self._tokens.expect(")")
                return inner
            if second.text == "in":
                vehicle = self._semantics.vehicle(self._name("a vehicle"))
                self._tokens.expect("in")
                state = self._semantics.state(vehicle, self._name("a state"))
                return tree.InState(vehicle, state)
            if first.text in _QUANTIFIERS and second.kind == "name":
                return self._group_in_state()
            return self._comparison()
        finally:
            self._depth -= 1

    def _group_in_state(self) -> tree.Condition:
        quantifier = cast("tree.Quantifier", self._tokens.take().text)
        first, _, rest = self._tokens.peek().text.partition(".")
        if rest in OBSERVABLES and self._tokens.peek(1).kind == "operator":
            raise self._value_of_each(quantifier, first, rest)
        name = self._name("a group")
        vehicles = self._semantics.group(name)
        self._tokens.expect("in")
        token, before = self._name("a state"), len(self._found.all)
        for vehicle in vehicles:
            if len(self._found.all) == before:
                self._semantics.state(vehicle, token)
        return tree.GroupInState(quantifier, name.text, vehicles, token.text)

    def _value_of_each(self, quantifier: str, group: str, name: str) -> Unreadable:
        """Report a comparison after `all` or `any`, and return the exception to raise. The hint
        writes it for each vehicle."""
        whole = self._tokens.take()
        start = whole.end
        self._tokens.take()
        if self._tokens.peek().kind in ("quantity", "name"):
            self._tokens.take()
        rest = f"{name}{self._text.text[start : self._tokens.behind()]}"
        members = self._scope.groups.get(group, (group,))
        word = "or" if quantifier == "any" else "and"
        message = f"`{quantifier}` takes `GROUP in STATE`, and no comparison"
        hint = f"write it of each vehicle: {of_each(members, rest, word)}"
        self._semantics.report(
            "KYB210", whole._replace(end=self._tokens.behind()), message, "", hint
        )
        return Unreadable()

    def _comparison(self) -> tree.Condition:
        left = self._operand()
        follows = self._tokens.peek()
        if follows.kind == "name" and (near := nearest(left.source, _QUANTIFIERS)):
            message = f"found `{follows.text}` where a comparison such as `<` should be"
            hint = f"did you mean `{near} {follows.text} in ...`?"
            raise self._tokens.stopped("KYB210", message, "", hint)
        token = self._tokens.of_kind("operator", "a comparison such as `<`")
        operator = cast("tree.ComparisonOperator", token.text)
        right = self._operand()
        if self._tokens.peek().kind == "operator":
            raise self._tokens.unexpected(_NEXT)
        compare = self._semantics.compared(left, operator, right)
        match compare:
            case tree.Compare(_, tree.Quantity(), tree.Aggregate()):
                return self._semantics.compared(right, FLIPPED[operator], left)
        return compare

    def _name(self, what: str) -> Token:
        return self._tokens.of_kind("name", what)

    def _quantity(self, dimension: Dimension) -> float:
        """Parse a quantity of `dimension` and return it in SI."""
        token = self._tokens.of_kind("quantity", f"a {dimension.name}")
        return self._semantics.measured(token, dimension, "")

    def _operand(self) -> Operand:
        """Parse one side of a comparison. A name is a function only if `(` follows it."""
        if self._tokens.peek().kind == "quantity":
            return Operand(self._tokens.take())
        token = self._name("a name or a quantity")
        if self._tokens.peek().text == "(":
            return self._call(token)
        return Operand(token, *self._meaning(token))

    def _meaning(self, token: Token) -> tuple[tree.Value | None, Dimension | None]:
        """Return the value that a dotted name reads, and its dimension; (None, None) for a name
        that may be a bare word."""
        scope, text = self._scope, token.text
        if scope.kind == "health":
            name = HEALTH.get(text)
            return (tree.Read(None, name), OBSERVABLES[name].dimension) if name else (None, None)
        if text == "time":
            return tree.MissionTime(), DURATION
        first, _, rest = text.partition(".")
        is_own = text in OBSERVABLES and scope.own is not None
        vehicle, name = (None, text) if is_own else (first, rest)
        if name in OBSERVABLES and (vehicle is None or vehicle in scope.vehicles):
            if name.partition(".")[0] == "payload":
                self._semantics.payload(vehicle or scope.own or "", token)
            return tree.Read(vehicle, name), OBSERVABLES[name].dimension
        thing = scope.objects.get(first)
        if thing is not None and rest in thing.values:
            return tree.ObjectRead(first, rest), OBJECT_OBSERVABLES[rest].dimension
        if rest in scope.inputs.get(first, ()):
            return tree.Axis(first, rest), NUMBER
        return None, None

    def _call(self, function: Token) -> Operand:
        self._tokens.expect("(")
        node: tree.Value | tree.Aggregate
        dimension: Dimension | None = LENGTH
        before = len(self._found.all)
        if function.text == "distance":
            node = self._distance(function)
        elif function.text == "separation":
            node = self._separation(function)
        elif function.text == "clearance":
            node = self._semantics.clearance(function, self._name("a vehicle"))
        elif function.text in _FUNCTIONS:
            node, dimension = self._aggregate(function)
        else:
            message = f"there is no function `{function.text}`"
            known = [*_FUNCTIONS, "distance", "separation", "clearance"]
            self._semantics.report_unknown(function, message, known)
            raise Unreadable
        self._tokens.expect(")")
        end = self._tokens.behind()
        whole = Token("name", self._text.text[function.start : end], function.start, end)
        return Operand(whole, node, dimension, len(self._found.all) > before)

    def _distance(self, function: Token) -> tree.Distance:
        a = self._place()
        self._tokens.expect("to")
        b = self._place()
        if a.obstacle is not None and b.obstacle is not None:
            message = f"`{a.obstacle}` and `{b.obstacle}` are both obstacles"
            hint = f"name a vehicle or a point: `distance({self._scope.a_vehicle} to {b.obstacle})`"
            whole = function._replace(end=self._tokens.behind())
            self._semantics.report("KYB212", whole, message, "no vehicle", hint)
        return tree.Distance(a, b)

    def _place(self) -> tree.Location:
        if self._tokens.skip("["):
            point = (self._quantity(LENGTH), self._quantity(LENGTH), self._quantity(LENGTH))
            self._tokens.expect("]")
            return tree.Location(None, point=point)
        token = self._name("a vehicle, a point or an obstacle")
        if token.text == "start" and self._scope.own is not None:
            return tree.Location(None, start=True)
        obstacle = self._semantics.obstacle(token)
        if obstacle is not None:
            return tree.Location(None, obstacle=obstacle)
        thing, _, surface = token.text.partition(".")
        if thing in self._scope.objects:
            self._semantics.surface(thing, surface, token)
            return tree.Location(None, object=thing, surface=surface)
        if token.text.startswith(PREFIX):
            return tree.Location(None, point=self._semantics.point(token))
        own = "payload" if token.text.endswith(".payload") else "start"
        name = token.text.removesuffix(f".{own}")
        self._semantics.vehicle(token._replace(text=name, end=token.start + len(name)))
        if name == token.text:
            return tree.Location(name)
        if own == "start":
            return tree.Location(name, start=True)
        self._semantics.payload(name, token)
        if self._scope.kind != "expectation":
            message = f"only a simulator knows where `{token.text}` is, so no condition can test it"
            hint = "test it in `expect:`; a condition can test `payload == released`"
            self._semantics.report("KYB213", token, message, "not here", hint)
        return tree.Location(name, payload=True)

    def _separation(self, function: Token) -> tree.Separation:
        vehicles, obstacles = dict[str, None](), dict[str, None]()
        token = self._name("a vehicle, a group or `all`")
        while True:
            if token.text == "all" and "all" not in self._scope.vehicles:
                vehicles |= dict.fromkeys(self._scope.vehicles)
            elif (obstacle := self._semantics.obstacle(token)) is not None:
                obstacles[obstacle] = None
            else:
                members = self._scope.groups.get(token.text)
                vehicles |= dict.fromkeys(members or (self._semantics.vehicle(token),))
            if not self._tokens.skip("and"):
                break
            token = self._name("a vehicle, a group or an obstacle")
        if not vehicles or len(vehicles) + len(obstacles) < 2:
            message = "a separation needs two vehicles, or a vehicle and an obstacle"
            hint = "write `separation(a and b)` or `separation(all)`"
            label = "one vehicle" if vehicles else "no vehicle"
            whole = function._replace(end=self._tokens.behind())
            self._semantics.report("KYB212", whole, message, label, hint)
        return tree.Separation(tuple(vehicles), tuple(obstacles))

    def _aggregate(self, token: Token) -> tuple[tree.Aggregate, Dimension | None]:
        self._has_statistics = True
        inner = self._operand()
        if not self._may_have_statistics:
            message = (
                f"`{token.text}(...)` covers the whole run, but a condition is checked in every "
                "tick"
            )
            hint = f"compare `{inner.source}` itself, or move the statistic to `expect:`"
            self._semantics.report("KYB213", token, message, "not here", hint)
        node, vehicle = inner.node, _subject(inner.node)
        if node is None and not is_quantity(inner):
            self._semantics.unknown_name(inner)
        elif not isinstance(node, tree.Measured) or inner.dimension is None:
            message = f"there is no statistic of `{inner.source}`"
            self._semantics.report("KYB212", inner.token, message, "not measured in numbers")
        elif token.text == "rms" and is_direction(node):
            message = f"there is no root mean square of `{inner.source}`, which is a direction"
            hint = "use `mean`, which averages directions"
            self._semantics.report("KYB212", token, message, "not of a direction", hint)
        measured = node if isinstance(node, tree.Measured) else tree.Read(None, "elapsed")
        state = None
        if self._tokens.skip("in"):
            name = self._name("a state")
            first, _, rest = name.text.partition(".")
            if vehicle is None and isinstance(node, tree.ObjectRead) and rest:
                vehicle = self._semantics.vehicle(
                    name._replace(text=first, end=name.start + len(first))
                )
                name = name._replace(text=rest, start=name.end - len(rest))
            state = self._semantics.state(vehicle or "", name)
            if vehicle is None and inner.node is not None and not inner.is_broken:
                message = f"`{inner.source}` belongs to no one vehicle that could be in `{state}`"
                hint = "leave out `in ...`"
                if isinstance(node, tree.ObjectRead):
                    hint += f", or name the vehicle: `in {self._scope.a_vehicle}.{state}`"
                self._semantics.report("KYB212", inner.token, message, "of no one vehicle", hint)
        function = cast("tree.Function", token.text)
        owner = vehicle if state else None
        return tree.Aggregate(function, measured, owner, state), inner.dimension


def _subject(node: object) -> str | None:
    """Return the vehicle that a value describes; for a distance, the first vehicle that it
    names."""
    if isinstance(node, tree.Read | tree.Clearance):
        return node.vehicle
    if isinstance(node, tree.Distance):
        return node.a.vehicle or node.b.vehicle
    return None
