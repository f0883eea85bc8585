"""A wheel built with `HATCH_BUILD_HOOK_ENABLE_MYPYC=true` is the plain one, only faster.

To compile it takes a minute: `--dist loadfile` has one worker do so. C code that isn't optimised
is compiled several times as fast, and its assertions are on; a release's optimised code is `slow`.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = [
    pytest.mark.thorough,
    pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler"),
]

ROOT = Path(__file__).parent.parent
LAB = ROOT / "examples" / "lab-parts"
SUFFIXES = """
from kybflow.runtime.trackers import cascade
from kybflow.runtime.vehicle import vehicle
print(*{module.__file__.rpartition(".")[2] for module in (cascade, vehicle)})
"""


def installed(source: Path, target: Path, settings: str = "", **environment: str) -> Path:
    """`target`, with the package in a copy of `source` and further settings installed into it."""
    ignored = shutil.ignore_patterns(".git", "build", "*.so", "runs")
    copied = shutil.copytree(source, target.with_suffix(".source"), ignore=ignored)
    with (copied / "pyproject.toml").open("a") as file:
        file.write(settings)
    command = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--target", str(target)]
    subprocess.run([*command, str(copied)], env={**os.environ, **environment}, check=True)
    return target


def ran(packages: tuple[Path, ...], *words: str) -> subprocess.CompletedProcess[str]:
    """What Python prints, started in the first of the folders in which it finds packages."""
    return subprocess.run(
        [sys.executable, *words],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(map(str, packages))},
        cwd=packages[0],
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture(scope="module", params=["O0", pytest.param("O3", marks=pytest.mark.slow)])
def wheel(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the wheel, compiled at a level of optimisation."""
    target = tmp_path_factory.mktemp("wheels") / "compiled"
    options = f"""
[tool.hatch.build.targets.wheel.hooks.mypyc.options]
opt_level = "{request.param[1]}"
"""
    # to look for what -Wall finds takes gcc most of its time: mypyc's C code is one file
    environment = {"HATCH_BUILD_HOOK_ENABLE_MYPYC": "true", "CFLAGS": "-Wno-all"}
    installed(ROOT, target, options, **environment)
    assert ran((target,), "-c", SUFFIXES).stdout == "so\n"
    return target


@pytest.fixture(scope="module")
def plain(wheel: Path) -> Path:
    """The same wheel without what is compiled."""
    target = wheel.with_name("plain")
    shutil.copytree(wheel, target, ignore=shutil.ignore_patterns("*.so"))
    assert ran((target,), "-c", SUFFIXES).stdout == "py\n"
    return target


@pytest.fixture(scope="module")
def lab(wheel: Path) -> Path:
    """A folder with a lab's own parts, which stay Python."""
    return installed(LAB, wheel.with_name("lab"))


@pytest.mark.parametrize(
    "mission", ["fallback", "formation", pytest.param("courier", marks=pytest.mark.slow)]
)
def test_it_records_the_same_bytes(wheel: Path, plain: Path, mission: str, tmp_path: Path) -> None:
    for package in (wheel, plain):
        words = ("kybflow", "run", f"kybflow/missions/{mission}.yaml", "--seed", "3", "--no-report")
        flown = ran((package,), "-m", *words, "--out", str(tmp_path / package.name))
        assert flown.returncode == 0, flown.stdout + flown.stderr
    for file in ("log.mcap", "events.jsonl"):
        recorded, expected = ((tmp_path / p.name / file).read_bytes() for p in (wheel, plain))
        assert len(expected) > 1000
        assert recorded == expected, file


@pytest.mark.parametrize(
    "words",
    [
        ("parts", "--check", str(ROOT / "docs" / "parts.md")),
        ("schema", "--check", str(ROOT / "schemas" / "mission.schema.json")),
        ("explain", "--check", str(ROOT / "docs" / "checks.md")),
    ],
)
def test_what_it_says_of_itself_is_the_same(wheel: Path, words: tuple[str, ...]) -> None:
    said = ran((wheel,), "-m", "kybflow", *words)
    assert said.returncode == 0, said.stderr


def test_its_flight_maths_pass_their_tests(wheel: Path) -> None:
    """What missions seldom reach, such as an alarm, must not raise when it is compiled."""
    tests = ROOT / "tests"
    words = ("-m", "pytest", "-q", "-p", "no:cacheprovider", str(tests / "flight"))
    supervisors = str(tests / "runtime" / "supervisors")
    judged = ran((wheel, tests / "support"), *words, supervisors)
    assert judged.returncode == 0, judged.stdout


def test_every_part_keeps_the_contract_a_labs_own_too(wheel: Path, lab: Path) -> None:
    contract = str(ROOT / "tests" / "parts" / "test_part_contract.py")
    judged = ran((wheel, lab), "-m", "pytest", "-q", "-p", "no:cacheprovider", contract)
    assert judged.returncode == 0, judged.stdout


def test_a_labs_own_part_flies_beside_it(wheel: Path, lab: Path, tmp_path: Path) -> None:
    words = ("run", str(LAB / "bob.yaml"), "--no-report", "--out", str(tmp_path))
    flown = ran((wheel, lab), "-m", "kybflow", *words)
    assert flown.returncode == 0, flown.stdout + flown.stderr
