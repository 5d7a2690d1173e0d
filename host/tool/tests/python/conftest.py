"""What the tests share: the tool, and a recording that it has made of the emulated board.

`cargo xtask ci --only python` builds the tool, and names it in the variable PALPATE.
"""

import json
import os
import subprocess
from pathlib import Path

import pytest


def pytest_addoption(parser):
    parser.addoption("--slow", action="store_true", help="run what takes minutes as well")


def pytest_configure(config):
    config.addinivalue_line("markers", "slow: takes minutes, and runs with --slow")


def pytest_collection_modifyitems(config, items):
    if not config.getoption("--slow"):
        for item in items:
            if "slow" in item.keywords:
                item.add_marker(pytest.mark.skip(reason="takes minutes: --slow runs it"))


class Tool:
    """`palpate`, run in a folder."""

    def __init__(self, folder: Path):
        self.program = os.environ["PALPATE"]
        self.folder = folder

    def run(self, *arguments: str) -> str:
        """Runs it to its end, and returns what it has printed."""
        command = [self.program, *arguments]
        done = subprocess.run(command, cwd=self.folder, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout

    def json(self, *arguments: str):
        """The same of a verb that prints JSON."""
        return json.loads(self.run(*arguments, "--json"))

    def start(self, *arguments: str) -> subprocess.Popen:
        """Starts it, and does not wait for its end."""
        command = [self.program, *arguments]
        return subprocess.Popen(command, cwd=self.folder, stdout=subprocess.PIPE, text=True)


@pytest.fixture(scope="session")
def palpate(tmp_path_factory) -> Tool:
    """The tool, in a folder of its own."""
    return Tool(tmp_path_factory.mktemp("palpate"))


@pytest.fixture(scope="session")
def emulated(palpate) -> list[str]:
    """Arguments for an emulated board whose flash is in the tool's folder. One program at a time may use it."""
    return ["--board", "emulated", "--image", os.environ["PALPATE_IMAGE"], "--state", "board.flash"]


@pytest.fixture(scope="session")
def recording(palpate, emulated) -> Path:
    """Two seconds of the emulated board."""
    palpate.run("record", "press.mcap", "--for", "2", *emulated)
    return palpate.folder / "press.mcap"
