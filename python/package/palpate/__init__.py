"""palpate: recordings, boards and simulated sensors of a tactile sensor that measures stiffness.

Every number is that of the tool `palpate`, whose libraries do the work; every failure is a
`PalpateError` with the tool's text. Names end with their unit, in SI: `force_n`, `stiffness_n_per_m`.
"""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Iterable, Iterator, MutableMapping

from . import _palpate, field
from ._palpate import PalpateError, Press, Record, Table

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any, Literal, Self, TypeAlias

    import pandas

    Path: TypeAlias = str | os.PathLike[str]
    Value: TypeAlias = bool | int | float | str

__all__ = [
    "Board",
    "PalpateError",
    "Press",
    "Record",
    "Recording",
    "Settings",
    "Simulator",
    "Table",
    "connect",
    "estimate",
    "field",
    "read",
]


class Recording:
    """The tables of a recording, one for each kind of record: `recording["estimate"]`.

    The recording itself stands for its samples, which `to_pandas()` and Arrow's C stream return.
    """

    def __init__(self, file: Path) -> None:
        self.file = os.fspath(file)
        self.tables, remarks = _palpate.read(self.file)
        for remark in remarks:
            warnings.warn(remark, stacklevel=3)

    @property
    def kinds(self) -> dict[str, int]:
        """Number of rows of each table."""
        return {kind: len(table) for kind, table in self.tables.items()}

    @property
    def samples(self) -> Table:
        """The samples: one row for each conversion of all channels."""
        return self["sample"]

    def __getitem__(self, kind: str) -> Table:
        try:
            return self.tables[kind]
        except KeyError:
            kinds = ", ".join(self.tables)
            raise KeyError(f"{self.file}: there is no {kind!r} in it; there are {kinds}") from None

    def __iter__(self) -> Iterator[str]:
        return iter(self.tables)

    def to_pandas(self) -> pandas.DataFrame:
        """The samples as a pandas `DataFrame`, whose `attrs["units"]` has the units."""
        return self.samples.to_pandas()

    def __arrow_c_schema__(self) -> object:
        return self.samples.__arrow_c_schema__()

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object:
        return self.samples.__arrow_c_stream__(requested_schema)

    def __repr__(self) -> str:
        return f"<palpate.Recording {self.file}: {self.kinds}>"


def read(file: Path) -> Recording:
    """Reads a recording of `palpate record`. Warns if it is cut off, and reads it as far as it goes."""
    return Recording(file)


def estimate(file: Path) -> list[Record]:
    """Computes the results in a recording again, by the firmware's own code: estimates and refusals.

    `record.matches` says whether a result has the very bytes that the board sent.
    """
    return _palpate.estimate(os.fspath(file))


class Settings(MutableMapping[str, "Value"]):
    """Settings in force on a board, by name. An assignment changes the board at once."""

    def __init__(self, board: _palpate.Board) -> None:
        self._board = board

    def __getitem__(self, name: str) -> Value:
        value: Value = self._board.read_settings()[name]
        return value

    def __setitem__(self, name: str, value: Value) -> None:
        self.change(**{name: value})

    def __delitem__(self, name: str) -> None:
        raise TypeError("a board has every setting: assign another value")

    def __iter__(self) -> Iterator[str]:
        return iter(self._board.read_settings())

    def __len__(self) -> int:
        return len(self._board.read_settings())

    def change(self, **values: Value) -> None:
        """Changes several settings by one command. They are lost at power-off unless `board.store()` follows."""
        texts = {name: str(value).lower() if isinstance(value, bool) else value for name, value in values.items()}
        self._board.change_settings([f"{name}={value}" for name, value in texts.items()])

    def __repr__(self) -> str:
        return repr(self._board.read_settings())


class Board(_palpate.Board):
    """A connected board, from `connect`. Iterating over it waits for each record.

    Of a real board records are read while the program computes, a minute of them at 1 kHz; what finds no
    room is dropped by the board, and counted in `record.dropped`.
    """

    @property
    def settings(self) -> Settings:
        """Settings in force."""
        return Settings(self)

    def send(self, command: str | dict[str, Any]) -> None:
        """Sends a command as `palpate encode` reads it: `"arm"`, `{"set_current": {...}}`."""
        self.send_json(json.dumps(command))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def connect(
    board: Path | None = None,
    *,
    wait_s: float = 60,
    load: float | None = None,
    speed: float | Literal["max"] | None = None,
    stack: Path | None = None,
    seed: int | None = None,
    image: Path | None = None,
    state: Path | None = None,
) -> Board:
    """Connects to a board, as the tool does: without a name, to the one that is plugged in.

    `board` is a serial port or a serial number, `emulated`, `tcp:HOST:PORT`, `probe:HOST:PORT,HOST:PORT`, or
    a recording; `wait_s` is the longest wait of `measure()` for a contact. The emulated board has a sensor of
    `stack` and `seed`, presses a spring of `load` times the sensing layer's stiffness, and runs the firmware
    `image`, with its flash in the file `state`. `speed` is that of a recording.
    """
    options = {
        "board": board,
        "wait": wait_s,
        "load": load,
        "speed": speed,
        "stack": stack,
        "seed": seed,
        "image": image,
        "state": state,
    }
    return Board(_arguments(options))


def _arguments(options: dict[str, Any]) -> list[str]:
    """Options of the tool."""
    return [f"--{name}={os.fspath(value) if hasattr(value, '__fspath__') else value}"
            for name, value in options.items() if value is not None]


class Simulator(_palpate.Simulator):
    """A simulated sensor with its disturbances, calibrated on its own simulated bench.

    `stack` is `paper`, `soft-closed`, `ultrasoft` or a stack file; `seed` draws the sensor. `disturbances` is
    `all` or `none`, but for those in `except_`.
    """

    _head: str

    def __new__(
        cls,
        stack: Path = "ultrasoft",
        *,
        seed: int = 1,
        disturbances: Literal["all", "none"] = "all",
        except_: Iterable[str] = (),
    ) -> Self:
        head = _toml({"stack": os.fspath(stack), "disturbances": disturbances, "except": list(except_)})
        # A scenario has at least one press; this one is not carried out.
        simulator = super().__new__(cls, head + '[[press]]\nload = "rigid"\n', seed)
        simulator._head = head
        return simulator

    def press(self, load: str = "spring", **keys: float | str) -> Press:
        """Presses an object and waits for the instrument's result.

        The keys are those of a press in a scenario file (`palpate simulate --help`): of a spring
        `stiffness_N_per_m`; of any press `depth_m`, `speed_m_per_s`, `holder`, `name`.
        """
        [press] = self.press_as(f"{self._head}[[press]]\n{_toml({'load': load, **keys})}")
        return press


def _toml(keys: dict[str, Any]) -> str:
    """Lines of a scenario file; a JSON value is TOML too."""
    plain = {key: value if isinstance(value, (str, list)) else float(value) for key, value in keys.items()}
    return "".join(f"{key} = {json.dumps(value)}\n" for key, value in plain.items())
