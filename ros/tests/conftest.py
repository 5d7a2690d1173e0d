"""What the tests share: the node, boards that play a recording, and subscribers of the real rclpy.

`cargo xtask ci --only ros` builds them, and names them in variables: PALPATE and PALPATE_IMAGE, the tool and the
firmware's image; PALPATE_ROS, the node; PLAYED_BOARDS. It runs these tests in a network of their own.
"""

import json
import os
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import rclpy
from geometry_msgs.msg import WrenchStamped
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

CALIBRATION = Path(__file__).parents[2] / "host/tool/tests/fixture/ultrasoft-11.jsonl"
# A minute at 1 kHz: a subscriber that is kept waiting by other programs loses nothing.
RELIABLE = QoSProfile(
    history=HistoryPolicy.KEEP_LAST, depth=60_000, reliability=ReliabilityPolicy.RELIABLE
)


def wait_until(condition: Callable[[], object], seconds: float, what: str) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, f"{what}: not within {seconds} s"
        time.sleep(0.01)


class Program:
    """A program whose standard error is collected."""

    def __init__(self, *command: str, **environment: str) -> None:
        self.lines: deque[str] = deque()
        self.process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env=os.environ | environment,
            text=True,
        )
        threading.Thread(target=self._collect, daemon=True).start()

    def _collect(self) -> None:
        assert self.process.stderr is not None
        for line in self.process.stderr:
            self.lines.append(line.rstrip())

    def wait_for(self, text: str, seconds: float = 30) -> None:
        wait_until(lambda: any(text in line for line in list(self.lines)), seconds, f"{text!r}, among {self.lines}")

    def write(self, line: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def end(self, how: signal.Signals = signal.SIGTERM) -> int:
        self.process.send_signal(how)
        return self.process.wait(timeout=30)


class Boards(Program):
    """Boards that play a recording."""

    def __init__(self, recording: str, count: int, rate_hz: int = 1000) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.first_port = free.getsockname()[1]
        self.count = count
        arguments = [recording, str(self.first_port), str(count), str(rate_hz)]
        super().__init__(os.environ["PLAYED_BOARDS"], *arguments)

    def arguments(self) -> list[str]:
        """The boards b0, b1, ... for the node."""
        ports = range(self.first_port, self.first_port + self.count)
        named = [f"b{index}=tcp:127.0.0.1:{port}" for index, port in enumerate(ports)]
        return [word for name in named for word in ["--board", name]]

    def unplug(self, board: int, seconds: float) -> None:
        self.write(f"unplug {board} {seconds}")

    def mute(self, board: int, seconds: float) -> None:
        """The board sends, and answers no commands."""
        self.write(f"mute {board} {seconds}")


class Listener:
    """A node of rclpy that keeps what it receives from `start` on.

    The executors of rclpy take a tenth of a millisecond for a message, so this polls the subscriptions itself.
    """

    PAUSE_S = 2e-4

    def __init__(self, name: str = "listener", domain: int = 0) -> None:
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = Node(name, context=self.context)
        self.subscriptions: list[tuple[Subscription, Callable]] = []
        self.is_ended = False
        self.thread = threading.Thread(target=self._poll, daemon=True)

    def start(self) -> None:
        self.thread.start()

    def _poll(self) -> None:
        while not self.is_ended:
            is_idle = True
            for subscription, take in self.subscriptions:
                with subscription.handle:
                    while taken := subscription.handle.take_message(subscription.msg_type, subscription.raw):
                        take(taken[0])
                        is_idle = False
            if is_idle:
                time.sleep(self.PAUSE_S)

    def _subscribe(self, kind: type, topic: str, quality: QoSProfile, take: Callable, raw: bool) -> None:
        subscription = self.node.create_subscription(kind, topic, take, quality, raw=raw)
        self.subscriptions.append((subscription, take))

    def listen(self, kind: type, topic: str, quality: QoSProfile = RELIABLE) -> list:
        """A list to which each message is added as it comes."""
        received: list = []
        self._subscribe(kind, topic, quality, received.append, raw=False)
        return received

    def forces(self, topic: str) -> list["Force"]:
        """Stamp, arrival and number of each sample of a board that plays a recording."""
        received: list[Force] = []

        def take(message: bytes) -> None:
            # The stamp follows the four bytes that name the encoding.
            second, nanosecond = struct.unpack_from("<iI", message, 4)
            # The force begins at a whole number of doubles after the name of the frame; z is its third.
            end = 12 + struct.unpack_from("<I", message, 12)[0]
            (z,) = struct.unpack_from("<d", message, 4 + -(-end // 8) * 8 + 16)
            received.append((second * 1_000_000_000 + nanosecond, time.time_ns(), round(-z)))

        self._subscribe(WrenchStamped, topic, RELIABLE, take, raw=True)
        return received

    def close(self) -> None:
        self.is_ended = True
        if self.thread.is_alive():
            self.thread.join(timeout=5)
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)


# Stamp and arrival, ns since 1970, and number of the sample.
Force = tuple[int, int, int]
PERIOD_NS = 1_000_000
NUMBERS = 10_000


def gaps(forces: list[Force]) -> list[int]:
    """Steps from each sample to the next: 1 where none is lost and the order is kept."""
    steps = [(after - before) % NUMBERS for (_, _, before), (_, _, after) in zip(forces, forces[1:])]
    return [step if step < NUMBERS // 2 else step - NUMBERS for step in steps]


def true_times_ns(forces: list[Force]) -> list[int]:
    """When the samples were due: at whole periods, by their numbers. The stamps are wrong by less than 5 s."""
    times = []
    for stamp, _, number in forces:
        period = round(stamp / PERIOD_NS)
        ahead = (number - period + NUMBERS // 2) % NUMBERS - NUMBERS // 2
        times.append((period + ahead) * PERIOD_NS)
    return times


def stamp_errors_ns(forces: list[Force]) -> list[int]:
    """Differences of the stamps from the true times."""
    return [stamp - true for (stamp, _, _), true in zip(forces, true_times_ns(forces))]


@pytest.fixture(scope="session")
def tool() -> Callable[..., str]:
    def run(*arguments: str) -> str:
        command = [os.environ["PALPATE"], *arguments]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


@pytest.fixture(scope="session")
def emulated(tool: Callable[..., str], tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Arguments for a calibrated emulated board."""
    state = tmp_path_factory.mktemp("emulated") / "board.flash"
    image = ["--image", os.environ["PALPATE_IMAGE"]]
    board = ["--seed", "11", "--state", str(state), *image]
    tool("settings", "import", str(CALIBRATION), "--store", "--board", "emulated", *board)
    return board


@pytest.fixture(scope="session")
def recording(tool: Callable[..., str], emulated: list[str], tmp_path_factory: pytest.TempPathFactory) -> str:
    """A press of an emulated board, with its result."""
    if "RECORDING" in os.environ:
        return os.environ["RECORDING"]
    file = str(tmp_path_factory.mktemp("recording") / "press.mcap")
    tool("record", file, "--board", "emulated", *emulated, "--load", "1.5", "--arm", "--for", "14")
    return file


@pytest.fixture
def boards(recording: str) -> Iterator[Callable[[int], Boards]]:
    started: list[Boards] = []

    def start(count: int) -> Boards:
        started.append(Boards(recording, count))
        return started[-1]

    yield start
    for board in started:
        board.process.kill()


@pytest.fixture
def node() -> Iterator[Callable[..., Program]]:
    started: list[Program] = []

    def start(*arguments: str, **environment: str) -> Program:
        started.append(Program(os.environ["PALPATE_ROS"], *arguments, **environment))
        return started[-1]

    yield start
    for program in started:
        if program.process.poll() is None:
            program.process.kill()


@pytest.fixture
def listener() -> Iterator[Callable[..., Listener]]:
    started: list[Listener] = []

    def start(name: str = "listener", domain: int = 0) -> Listener:
        started.append(Listener(name, domain))
        return started[-1]

    yield start
    for one in started:
        one.close()


def palpate_json(text: str) -> dict:
    """The last line of `--json` output."""
    return json.loads(text.strip().splitlines()[-1])


if sys.version_info[:2] != (3, 11):
    sys.exit("the wheels of ROS 2 need Python 3.11")
