"""A package of missions: built by setuptools and by hatchling, its YAML installed, found, used."""

from __future__ import annotations

import re
import shutil
import subprocess
import zipfile
from pathlib import Path

import pytest
from toolchain import ROOT, program

pytestmark = pytest.mark.thorough

pytest.importorskip("setuptools", minversion="70.1")
EXAMPLE = ROOT / "examples" / "lab-missions"
HATCHLING = 'requires = ["hatchling"]\nbuild-backend = "hatchling.build"'
SHIPPED = {"lab_missions/missions/square.yaml", "lab_missions/missions/library/lab.yaml"}


def source(where: Path, backend: str) -> Path:
    """A copy of the example that is built by `backend`."""
    copy = Path(shutil.copytree(EXAMPLE, where / "source"))
    file = copy / "pyproject.toml"
    text = file.read_text(encoding="utf-8")
    assert "setuptools.build_meta" in text
    if backend == "hatchling":
        text = re.sub(r"requires = .*\nbuild-backend = .*", HATCHLING, text, count=1)
        file.write_text(text, encoding="utf-8")
    return copy


def said(done: subprocess.CompletedProcess[str]) -> str:
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.parametrize("backend", ["setuptools", "hatchling"])
def test_the_wheel_has_the_missions_and_libraries(backend: str, tmp_path: Path) -> None:
    build = ("wheel", "--quiet", "--no-deps", "--no-build-isolation", "--wheel-dir")
    said(program(*build, tmp_path, source(tmp_path, backend), module="pip"))
    [wheel] = tmp_path.glob("*.whl")
    assert set(zipfile.ZipFile(wheel).namelist()) >= SHIPPED


@pytest.fixture(scope="module")
def lib(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder in which the example is installed, as setuptools installs it."""
    where = tmp_path_factory.mktemp("site")
    install = ("install", "--quiet", "--no-deps", "--no-build-isolation", "--target")
    said(program(*install, where / "lib", source(where, "setuptools"), module="pip"))
    return where / "lib"


def test_the_library_command_finds_them(lib: Path, tmp_path: Path) -> None:
    listed = said(program("library", cwd=tmp_path, path=[lib]))
    assert "lab_missions/lab  The lab's room and its vehicle." in listed
    assert re.search(r"lab_missions/square +Around the lab's room once\.", listed)
    assert "speed = 50 cm/s" in listed
    assert "bee:" in said(program("library", "lab_missions/lab", cwd=tmp_path, path=[lib]))


def test_a_mission_begins_with_one_of_them(lib: Path, tmp_path: Path) -> None:
    new = ("new", "my_square", "--from", "lab_missions/square")
    said(program(*new, cwd=tmp_path, path=[lib]))
    judged = said(program("validate", "my_square.yaml", cwd=tmp_path, path=[lib]))
    assert "my_square.yaml: ok" in judged
