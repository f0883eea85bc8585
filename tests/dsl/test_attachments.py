"""Files that parameters name: what is read, what is refused, and that the plan says which."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest
from toolchain import compiled, result_of

from kybflow.core.errors import OptionRefused
from kybflow.core.files import File
from kybflow.dsl.reading.values import MAX_FILE_BYTES
from kybflow.runtime.options import check_options

MISSION = """kybflow: 1
mission: way
import: {std: kybflow/airframes}
parameters:
  way: {type: text, default: ways/way.csv}
vehicles:
  a:
    like: std.nano_plus
    start: {at: [0, 0, 0]}
    behaviors:
      up:   {do: take_off, height: 1 m, then: way}
      way:  {do: follow_trajectory, file: $way, then: down}
      down: {do: land}
"""
TABLE = b"t, x, y, z\n0, 0, 0, 1\n4, 1, 0, 1\n"


@pytest.fixture
def mission(tmp_path: Path) -> Path:
    (tmp_path / "ways").mkdir()
    (tmp_path / "ways/way.csv").write_bytes(TABLE)
    path = tmp_path / "mission.yaml"
    path.write_text(MISSION)
    return path


def messages(path: Path, way: str) -> list[str]:
    return [d.message for d in result_of(path, sets=(f"way={way}",)).diagnostics]


def test_a_file_is_read_beside_the_mission_and_stands_in_its_sources(mission: Path) -> None:
    plan = compiled(mission, warns=True)
    digest = hashlib.sha256(TABLE).hexdigest()
    params = plan.vehicles[0].states["way"].behavior.params
    assert params.file == File("ways/way.csv", digest, TABLE.decode())
    source = next(s for s in plan.sources if s.path.endswith(".csv"))
    assert (source.path, source.sha256) == (str(mission.parent / "ways/way.csv"), digest)


def test_what_was_compiled_is_what_flies(mission: Path) -> None:
    plan = compiled(mission, warns=True)
    (mission.parent / "ways/way.csv").unlink()
    assert plan.vehicles[0].states["way"].behavior.params.file.text == TABLE.decode()


def test_it_is_no_option(mission: Path) -> None:
    plan = compiled(mission, warns=True)
    with pytest.raises(OptionRefused, match="read-only"):
        check_options(plan, [("a.behaviors.way.file", "other.csv")])


@pytest.mark.parametrize("name", ["../way.csv", "/etc/passwd", "ways/../../x", "outside/way.csv"])
def test_nothing_outside_of_the_folder_is_read(mission: Path, name: str, tmp_path_factory) -> None:
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    (elsewhere / "way.csv").write_bytes(TABLE)
    (mission.parent / "outside").symlink_to(elsewhere)
    assert messages(mission, name) == [f"`{name}` is outside of the mission's folder"]


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"t\xff\n", "`ways/bad.csv` is not UTF-8 text on line 1"),
        (b"#" * (MAX_FILE_BYTES + 1), "`ways/bad.csv` is larger than 4 MB"),
        (b"", "`ways/bad.csv`: it has no header"),
    ],
)
def test_what_is_no_table_is_refused(mission: Path, data: bytes, message: str) -> None:
    (mission.parent / "ways/bad.csv").write_bytes(data)
    assert messages(mission, "ways/bad.csv") == [message]


@pytest.mark.parametrize("name", ["ways", "'.'", "no/such.csv", "x" * 300])
def test_what_is_no_file_is_refused(mission: Path, name: str) -> None:
    (message,) = messages(mission, name)
    assert any(why in message for why in ("is not a file", "there is no file", "can't be read"))
