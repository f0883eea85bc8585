"""A package of missions: built by setuptools and by hatchling, its YAML installed, found, used."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from toolchain import ROOT

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


def pip(*words: str) -> None:
    command = [sys.executable, "-m", "pip", *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("backend", ["setuptools", "hatchling"])
def test_the_wheel_has_the_missions_and_libraries(backend: str, tmp_path: Path) -> None:
    build = ("wheel", "--quiet", "--no-deps", "--no-build-isolation", "--wheel-dir")
    pip(*build, str(tmp_path), str(source(tmp_path, backend)))
    [wheel] = tmp_path.glob("*.whl")
    assert set(zipfile.ZipFile(wheel).namelist()) >= SHIPPED


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The environment of a Python that has the example installed, as setuptools installs it."""
    where = tmp_path_factory.mktemp("site")
    install = ("install", "--quiet", "--no-deps", "--no-build-isolation", "--target")
    pip(*install, str(where / "lib"), str(source(where, "setuptools")))
    path = os.pathsep.join(filter(None, [str(where / "lib"), os.environ.get("PYTHONPATH", "")]))
    return {**os.environ, "PYTHONPATH": path}


def kybflow(environment: dict[str, str], folder: Path, *words: str) -> str:
    command = [sys.executable, "-m", "kybflow", *words]
    done = subprocess.run(
        command, env=environment, cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_the_library_command_finds_them(installed: dict[str, str], tmp_path: Path) -> None:
    listed = kybflow(installed, tmp_path, "library")
    assert "lab_missions/lab  The lab's room and its vehicle." in listed
    assert re.search(r"lab_missions/square +Around the lab's room once\.", listed)
    assert "speed = 50 cm/s" in listed
    assert "bee:" in kybflow(installed, tmp_path, "library", "lab_missions/lab")


def test_a_mission_begins_with_one_of_them(installed: dict[str, str], tmp_path: Path) -> None:
    kybflow(installed, tmp_path, "new", "my_square", "--from", "lab_missions/square")
    assert "my_square.yaml: ok" in kybflow(installed, tmp_path, "validate", "my_square.yaml")
