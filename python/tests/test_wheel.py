"""The wheel by itself: in an empty environment, with the README's own lines."""

import os
import re
import statistics
import subprocess
import sys
from pathlib import Path

import pytest

README = Path(__file__).parents[1] / "README.md"
# Processor time: the clock on the wall depends on what else the computer does.
IMPORT = "import time; began = time.process_time(); import palpate; print(time.process_time() - began)"


@pytest.fixture(scope="session")
def bare(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Python of an environment that has the wheel and nothing else."""
    folder = tmp_path_factory.mktemp("bare")
    subprocess.run([sys.executable, "-m", "venv", str(folder)], check=True)
    python = str(folder / "bin/python")
    wheel = os.environ["PALPATE_WHEEL"]
    subprocess.run([python, "-m", "pip", "install", "--quiet", "--no-index", wheel], check=True)
    return python


def run(python: str, program: str, folder: Path) -> str:
    done = subprocess.run([python, "-c", program], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_first_lines_of_the_readme_work(bare: str, tmp_path: Path) -> None:
    program = re.findall(r"```python\n(.*?)```", README.read_text(), re.DOTALL)[0]
    assert len(program.splitlines()) == 5
    printed = run(bare, program, tmp_path)
    assert "n_per_m" in printed


def test_the_import_takes_less_than_50_ms(bare: str, tmp_path: Path) -> None:
    times_s = [float(run(bare, IMPORT, tmp_path)) for _ in range(20)]
    assert statistics.median(times_s) < 0.05


def test_pandas_and_arrow_are_not_imported_eagerly(tmp_path: Path) -> None:
    loaded = "import sys, palpate; print([name for name in ('pandas', 'pyarrow', 'numpy') if name in sys.modules])"
    assert run(sys.executable, loaded, tmp_path) == "[]\n"


def test_the_wheel_is_small() -> None:
    assert Path(os.environ["PALPATE_WHEEL"]).stat().st_size <= 5_000_000
