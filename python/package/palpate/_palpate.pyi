"""The extension module, built from `src`."""

from os import PathLike
from typing import Any, Self, final

import pandas

__all__ = [
    "Board",
    "Field",
    "PalpateError",
    "Press",
    "Record",
    "Simulator",
    "Table",
    "designs",
    "estimate",
    "read",
]

class PalpateError(Exception):
    """A refusal or a failure. The text is the tool's own: where, why, and what to do."""

@final
class Table:
    """Rows with typed columns. Arrow's C stream carries them, each column's unit in its metadata."""

    @property
    def columns(self) -> list[str]:
        """Names of the columns."""

    @property
    def units(self) -> dict[str, str]:
        """Units by column, of those that have one; `1` for plain numbers."""

    def to_pandas(self) -> pandas.DataFrame:
        """The table as a pandas `DataFrame`, whose `attrs["units"]` has the units. Needs pandas and pyarrow."""

    def __len__(self) -> int: ...
    def __arrow_c_schema__(self) -> object: ...
    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object: ...

@final
class Record:
    """A record of a board, with its header."""

    @property
    def kind(self) -> str:
        """Kind, as `sample` or `estimate`; docs/protocol.md has all of them with their fields."""

    @property
    def time_s(self) -> float:
        """Time by the board's clock, s."""

    @property
    def time_us(self) -> int:
        """Time by the board's clock, us."""

    @property
    def boot_id(self) -> int:
        """Number of the board's present run."""

    @property
    def sequence(self) -> int:
        """Number of the record in this run."""

    @property
    def dropped(self) -> int:
        """Records that the board has dropped so far, for want of room."""

    @property
    def matches(self) -> bool | None:
        """Whether a record that `estimate` has computed has the board's very bytes; `None` for a received one."""

    @property
    def fields(self) -> dict[str, Any]:
        """The fields by name, as in the tool's JSON; a new dictionary at each call."""

    def __getitem__(self, name: str, /) -> Any: ...

class Board:
    def __new__(cls, arguments: list[str]) -> Self: ...
    @property
    def name(self) -> str:
        """Location of the board."""

    @property
    def hello(self) -> dict[str, Any]:
        """Identity of the board at the connection."""

    def measure(self) -> dict[str, Any]:
        """Arms the board, measures at the next contact, and disarms it: a line of `palpate measure --json`."""

    def read_settings(self) -> dict[str, Any]:
        """Settings in force by name."""

    def change_settings(self, assignments: list[str]) -> None:
        """Changes settings, each as `NAME=VALUE`."""

    def store(self) -> dict[str, Any]:
        """Stores settings and calibration, so that they survive power-off; returns the state of the storage."""

    def send_json(self, command: str) -> None:
        """Sends a command as JSON; it must be accepted."""

    def close(self) -> None:
        """Closes the link. A board that this program armed is disarmed."""

    def __iter__(self) -> Self: ...
    def __next__(self) -> Record: ...

class Simulator:
    def __new__(cls, scenario: str, seed: int) -> Self: ...
    def press_as(self, scenario: str) -> list[Press]:
        """Carries out the presses of a scenario file's text."""

    @property
    def description(self) -> str:
        """Sensor and calibration in words, as `palpate simulate` prints them."""

    @property
    def depth_m(self) -> float:
        """Working depth: deformation of the sensing layer at rest, m."""

    @property
    def sensing_n_per_m(self) -> float:
        """True stiffness of the sensing layer, N/m."""

@final
class Press:
    """A press on a simulated sensor."""

    @property
    def result(self) -> dict[str, Any]:
        """Result with the truth: a line of `palpate simulate --json`."""

    @property
    def records(self) -> list[Record]:
        """Every record of the instrument, in order."""

    @property
    def tables(self) -> dict[str, Table]:
        """The records as tables, by kind."""

    @property
    def truth(self) -> Table:
        """True state of sensor and object, a row about every millisecond."""

    def save(self, file: str | PathLike[str]) -> None:
        """Writes the records as a recording, which every verb of the tool reads."""

@final
class Field:
    """A solved design."""

    def __new__(cls, arguments: list[str]) -> Self: ...
    @property
    def figures(self) -> dict[str, Any]:
        """Figures of the field with their errors, in SI units, as in `palpate field solve --json`."""

    @property
    def core_r_m(self) -> float:
        """Radius of the core, m."""

    @property
    def core_x_m(self) -> tuple[float, float]:
        """Ends of the core on the axis, m."""

    def profile(
        self, along: str, from_mm: float | None = None, to_mm: float | None = None, points: int = 201
    ) -> tuple[list[float], list[float], list[float]]:
        """Positions, m, and flux densities B_r and B_x, T, along a line, with the mesh refined there.

        `along` is `axis`, `radius@x=MM` or `parallel@r=MM`.
        """

    def at(self, points: list[tuple[float, float]]) -> list[tuple[float, float]]:
        """Flux densities (B_r, B_x), T, at points (r, x), m."""

def read(file: str) -> tuple[dict[str, Table], list[str]]: ...
def estimate(file: str) -> list[Record]: ...
def designs() -> list[str]:
    """Names of the built-in designs."""
