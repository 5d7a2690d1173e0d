"""What the tests share: the tool, the emulated board, and a simulated press with its recording.

`cargo xtask ci --only python-package` builds tool and image, and names them in the variables PALPATE and
PALPATE_IMAGE.
"""

import json
import os
import subprocess
from pathlib import Path
from typing import Any

import pytest

import palpate

SCENARIO = """\
stack = "ultrasoft"
disturbances = "all"
except = ["tremor"]
[[press]]
load = "spring"
stiffness_N_per_m = 5e3
name = "a spring"
"""


class Tool:
    """`palpate`, run in a folder."""

    def __init__(self, folder: Path) -> None:
        self.program = os.environ["PALPATE"]
        self.folder = folder

    def start(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        command = [self.program, *arguments]
        return subprocess.run(command, cwd=self.folder, capture_output=True, text=True, check=False)

    def run(self, *arguments: str) -> str:
        """What it prints; it has to succeed."""
        done = self.start(*arguments)
        assert done.returncode == 0, done.stderr
        return done.stdout

    def refused(self, *arguments: str) -> str:
        """The text of its failure."""
        done = self.start(*arguments)
        assert done.returncode != 0
        return done.stderr.rstrip().removeprefix("palpate: ")


@pytest.fixture(scope="session")
def tool(tmp_path_factory: pytest.TempPathFactory) -> Tool:
    return Tool(tmp_path_factory.mktemp("palpate"))


@pytest.fixture(scope="session")
def image() -> str:
    return os.environ["PALPATE_IMAGE"]


@pytest.fixture(scope="session")
def simulator() -> palpate.Simulator:
    return palpate.Simulator("ultrasoft", seed=3, except_=["tremor"])


@pytest.fixture(scope="session")
def press(simulator: palpate.Simulator) -> palpate.Press:
    return simulator.press("spring", stiffness_N_per_m=5e3, name="a spring")


@pytest.fixture(scope="session")
def recording(press: palpate.Press, tool: Tool) -> str:
    """The simulated press as a recording."""
    file = str(tool.folder / "press.mcap")
    press.save(file)
    return file


@pytest.fixture(scope="session")
def simulated(tool: Tool) -> dict[str, Any]:
    """The tool's line for the same press, and its records."""
    (tool.folder / "scenario.toml").write_text(SCENARIO)
    line = tool.run("simulate", "scenario.toml", "--seed", "3", "--json", "--records", "records.jsonl")
    records = (tool.folder / "records.jsonl").read_text().splitlines()
    return {"result": json.loads(line), "records": [json.loads(text) for text in records[1:]]}
