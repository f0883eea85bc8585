"""A person at the terminal of a run, in a test."""

from __future__ import annotations

from kybflow.cli.keys import Offer, TerminalCommander
from kybflow.runtime.engine import Engine


class TypedKeys:
    """In place of a terminal: what is typed is read once."""

    def __init__(self) -> None:
        self.typed = b""
        self.is_open = False

    def __enter__(self) -> TypedKeys:
        self.is_open = True
        return self

    def __exit__(self, *error: object) -> None:
        self.is_open = False

    def read(self) -> bytes:
        typed, self.typed = self.typed, b""
        return typed


class Person:
    """Looks at the table and presses keys. time: of their clock, s."""

    def __init__(self) -> None:
        self.keys = TypedKeys()
        self.time = 0.0
        self.commander = TerminalCommander(self.keys, lambda: self.time)

    def press(self, engine: Engine, *names: str) -> None:
        """Press the keys of what is offered under these names; `enter` is that key."""
        self.see(engine)
        for name in names:
            self.keys.typed += b"\r" if name == "enter" else self.offer(name).key.encode()
        self.commander.read_keys()

    def see(self, engine: Engine) -> None:
        self.commander.update(engine.commander.situation(engine.clock.now, flying=engine.flying))

    def offer(self, name: str) -> Offer:
        """The offer of `name`, or of `vehicle name`."""
        group, _, own = name.rpartition(" ")
        [found] = (o for o in self.commander.offers if o.name == own and group in ("", o.group))
        return found

    def says(self) -> str:
        return self.commander.message.text
