"""A mission in an editor: what the YAML language server completes, shows and reports with the
schema that the mission's first line names. `npm install --global yaml-language-server@1` brings it.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from toolchain import ROOT

from kybflow.dsl.diagnostics import Collector
from kybflow.dsl.reading.reader import compose
from kybflow.dsl.reading.values import decode_value
from kybflow.parts.catalog import load_catalog

MISSIONS = sorted((ROOT / "missions").glob("*.yaml"))
SERVER = shutil.which("yaml-language-server")
pytestmark = [
    pytest.mark.thorough,
    pytest.mark.skipif(
        SERVER is None, reason="npm install --global yaml-language-server@1 brings it"
    ),
]


class Server:
    """The server over stdio; messages are JSON-RPC behind a header with their length."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [str(SERVER), "--stdio"], stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )
        self._number = 0
        self.reported: dict[str, list[dict[str, Any]]] = {}
        root = ROOT.as_uri()
        self.ask("initialize", {"processId": None, "rootUri": root, "capabilities": {}})
        self.tell("initialized", {})

    def close(self) -> None:
        self.ask("shutdown", None)
        self.tell("exit", None)
        with self._process:
            self._process.wait(timeout=300)

    def open(self, path: Path, text: str) -> str:
        """Open a text as if it were the file at `path`."""
        document = {"uri": path.as_uri(), "languageId": "yaml", "version": 1, "text": text}
        self.tell("textDocument/didOpen", {"textDocument": document})
        return document["uri"]

    def at(self, method: str, uri: str, line: int, character: int) -> Any:
        """Ask about a place, counted from 0."""
        place = {"line": line, "character": character}
        return self.ask(method, {"textDocument": {"uri": uri}, "position": place})

    def report(self, uri: str) -> list[dict[str, Any]]:
        """What the server finds in a document, as soon as it says so."""
        while uri not in self.reported:
            self._take(self._read())
        return self.reported[uri]

    def tell(self, method: str, params: Any) -> None:
        self._send({"jsonrpc": "2.0", "method": method, "params": params})

    def ask(self, method: str, params: Any) -> Any:
        self._number += 1
        number = self._number
        self._send({"jsonrpc": "2.0", "id": number, "method": method, "params": params})
        while True:
            message = self._read()
            if message.get("id") == number and "method" not in message:
                return message["result"]
            self._take(message)

    def _take(self, message: dict[str, Any]) -> None:
        """Note a report; answer a question of the server with nothing."""
        if message.get("method") == "textDocument/publishDiagnostics":
            params = message["params"]
            self.reported[params["uri"]] = params["diagnostics"]
        elif "id" in message and "method" in message:
            items = message.get("params", {}).get("items", [])
            self._send({"jsonrpc": "2.0", "id": message["id"], "result": [None] * len(items)})

    def _send(self, message: dict[str, Any]) -> None:
        body = json.dumps(message).encode()
        assert self._process.stdin is not None
        self._process.stdin.write(b"Content-Length: %d\r\n\r\n%s" % (len(body), body))
        self._process.stdin.flush()

    def _read(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        length = 0
        while line := self._process.stdout.readline().strip():
            name, _, value = line.partition(b":")
            length = int(value) if name.lower() == b"content-length" else length
        message: dict[str, Any] = json.loads(self._process.stdout.read(length))
        return message


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    found = Server()
    yield found
    found.close()


SCHEMA = "# yaml-language-server: $schema=../schemas/mission.schema.json\n"


def draft(server: Server, name: str, rest: str) -> str:
    """The address of a mission that is being written beside the others."""
    text = f"{SCHEMA}kybflow: 1\nmission: draft\n{rest}"
    return server.open(ROOT / "missions" / f"{name}.yaml", text)


def opened(server: Server, name: str, behaviors: str) -> tuple[str, list[str]]:
    """A draft with behaviors; its address and lines."""
    rest = "vehicles:\n  a:\n    behaviors:\n" + behaviors
    return draft(server, name, rest), f"\n\n\n{rest}".split("\n")


def completions(server: Server, uri: str, line: int, character: int) -> list[dict[str, str]]:
    answer = server.at("textDocument/completion", uri, line, character)
    return answer["items"] if isinstance(answer, dict) else answer


def labels(server: Server, uri: str, line: int, character: int) -> set[str]:
    return {item["label"] for item in completions(server, uri, line, character)}


def test_it_completes_the_names_of_parts(server: Server) -> None:
    uri, lines = opened(server, "parts", "      up:\n        do: \n")
    found = labels(server, uri, len(lines) - 2, 12)
    assert {"take_off", "fly_to", "land", "follow_path"} <= found


def test_it_completes_the_parameters_of_a_part(server: Server) -> None:
    uri, lines = opened(server, "keys", "      up:\n        do: take_off\n        \n")
    found = labels(server, uri, len(lines) - 2, 8)
    assert {"height", "then", "within"} <= found


LISTS = {"estimators", "processors", "supervisors"}
KINDS = ("behaviors", "estimators", "processors", "supervisors", "trackers")
CATALOG = load_catalog()
PARTS = [(kind, name) for kind in KINDS for name in CATALOG.names(kind)]


def completed(server: Server, kind: str, name: str) -> dict[str, str]:
    """What completing each parameter of a part inserts, without the marks of a snippet."""
    place = "tracker" if kind == "trackers" else kind
    lead = "- " if kind in LISTS else ""
    inner = "      p:\n        do:" if kind == "behaviors" else f"    {place}:\n      {lead}use:"
    indent = 8 if kind == "behaviors" or lead else 6
    rest = "vehicles:\n  a:\n" + "    behaviors:\n" * (kind == "behaviors")
    rest += f"{inner} {name}\n" + " " * indent + "\n"
    uri = draft(server, f"{kind}_{name}", rest)
    items = completions(server, uri, rest.count("\n") + 2, indent)
    plain = {i["label"]: re.sub(r"\$\{\d+:([^}]*)\}|\$\d+", r"\1", i["insertText"]) for i in items}
    return {label: text.partition(":")[2].strip() for label, text in plain.items()}


@pytest.mark.parametrize(("kind", "name"), PARTS, ids=[f"{k}.{n}" for k, n in PARTS])
def test_completing_a_parameter_inserts_a_right_value_with_its_unit(
    server: Server, kind: str, name: str
) -> None:
    inserted = completed(server, kind, name)
    for field in CATALOG.get(kind, name).fields:
        value = inserted[field.name]
        if field.dimension is not None and field.dimension.units:
            assert any(unit in value for unit in field.dimension.units), field.name
        if field.dimension is not None or value:
            found = Collector()
            node = compose(value, "editor", found)
            assert node is not None
            decode_value(node, field, found)
            assert found.all == [], field.name


def test_every_dimension_of_a_part_is_completed() -> None:
    fields = [field for kind, name in PARTS for field in CATALOG.get(kind, name).fields]
    kinds = {(f.dimension.name, f.shape) for f in fields if f.dimension is not None}
    assert {"length", "speed", "duration", "angle", "acceleration"} <= {name for name, _ in kinds}
    assert {"scalar", "vector", "path", "matrix"} == {shape for _, shape in kinds}


@pytest.mark.parametrize(
    "keys",
    [
        "        then: \n",
        "        failed: \n",
        "        next:\n          - when: \n",
        "        next:\n          - event: \n",
        "        within: \n",
    ],
)
def test_it_offers_no_null(server: Server, keys: str) -> None:
    name = "null_" + re.sub(r"\W", "", keys)
    uri, lines = opened(server, name, "      up:\n        do: take_off\n" + keys)
    found = labels(server, uri, len(lines) - 2, len(lines[-2]))
    assert found
    assert "null" not in found


@pytest.mark.parametrize(
    ("key", "unit"),
    [("mass", "kg"), ("thrust", "N"), ("rate_gain", "1/s"), ("tilt", "deg"), ("rotor_time", "m?s")],
)
def test_completing_a_key_of_an_airframe_inserts_its_unit(
    server: Server, key: str, unit: str
) -> None:
    items = completions(server, draft(server, "airframes", "airframes:\n  x:\n    \n"), 5, 4)
    (inserted,) = (item["insertText"] for item in items if item["label"] == key)
    assert re.fullmatch(rf"{key}: [\d.]+ {unit}", inserted)


@pytest.mark.parametrize(("key", "expected"), [("like", set()), ("tracker", {"cascade"})])
def test_it_offers_no_null_for_a_vehicle(server: Server, key: str, expected: set[str]) -> None:
    uri = draft(server, f"null_{key}", f"vehicles:\n  a:\n    {key}: \n")
    found = labels(server, uri, 5, len(key) + 6)
    assert "null" not in found
    assert expected <= found


@pytest.mark.parametrize(
    ("state", "said"),
    [
        (
            "take_off, height: 1 s",
            "A length, like `1.2 m`, is needed; its units are m, cm, mm, km.",
        ),
        (
            "take_off, within: soon",
            "A duration, like `300 ms`, is needed; its units are s, ms, min.",
        ),
        ("circle, center: [0, 0, 1 s]", "A length, like `1.2 m`, is needed"),
        ("circle, center: 5", "`[x, y, z]` is needed, each a length, like `1.2 m`."),
        ("take_off, then: [a]", "Text is needed."),
        ("land, within: null", ""),
    ],
)
def test_what_is_wrong_is_told_in_words(server: Server, state: str, said: str) -> None:
    name = "words_" + re.sub(r"\W", "", state)
    uri, _ = opened(server, name, f"      up: {{do: {state}}}\n")
    found = [finding["message"] for finding in server.report(uri)]
    assert len(found) == bool(said)
    assert all(message.startswith(said) for message in found)


@pytest.mark.parametrize(
    ("gain", "said"),
    [
        ("[[4, 0, 0], [0, 4, 0], [0, 0, 4]]", ""),
        ("4", "`[[...], ...]` is needed, 3 rows of 3, each a number, like `2`."),
        ("[[4, 0, 0], [0, 4, 0], 4]", "A row of 3 is needed, `[...]`, each a number, like `2`."),
        ("[[4, 0, 0], [0, 4, 0]]", "Array has too few items. Expected 3 or more."),
        ("[[4, 0], [0, 4, 0], [0, 0, 4]]", "Array has too few items. Expected 3 or more."),
        ("[[4, 0, 0], [0, four, 0], [0, 0, 4]]", "A number, like `2`, is needed."),
    ],
)
def test_what_is_wrong_with_a_matrix_is_told_in_words(server: Server, gain: str, said: str) -> None:
    tracker = f"    tracker:\n      use: cascade\n      position_gain: {gain}\n"
    uri = draft(server, f"matrix_{len(gain)}", f"vehicles:\n  a:\n{tracker}")
    found = [finding["message"] for finding in server.report(uri)]
    assert len(found) == bool(said)
    assert all(message.startswith(said) for message in found)


def test_a_reaction_is_completed_and_a_wrong_one_told(server: Server) -> None:
    text = "vehicles:\n  a:\n    supervisors:\n      - use: battery\n        reaction: "
    uri = draft(server, "reaction", text + "\n")
    assert {"brake", "land"} <= labels(server, uri, 7, 18)
    uri = draft(server, "reactions", text + "lnad\n")
    (finding,) = server.report(uri)
    assert finding["message"].startswith("One of `warn`, `brake`, ")


def test_it_shows_what_a_parameter_is(server: Server) -> None:
    uri, lines = opened(server, "hover", "      up:\n        do: take_off\n        height: 1 m\n")
    found = server.at("textDocument/hover", uri, len(lines) - 2, 10)
    shown = found["contents"]["value"].replace("\\", "")
    assert "Height above the ground of the start. Above 0 m." in shown
    assert "A length [m], like `1.2 m`." in shown


def test_it_reports_what_has_the_wrong_unit(server: Server) -> None:
    uri, lines = opened(server, "wrong", "      up:\n        do: take_off\n        height: 1 s\n")
    assert {d["range"]["start"]["line"] for d in server.report(uri)} == {len(lines) - 2}


@pytest.mark.parametrize("path", MISSIONS, ids=[path.stem for path in MISSIONS])
def test_it_reports_nothing_of_a_good_mission(server: Server, path: Path) -> None:
    uri = server.open(path, path.read_text(encoding="utf-8"))
    assert server.report(uri) == []
