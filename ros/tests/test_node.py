"""The node beside the real rclpy with Fast DDS: boards that play a recording, and the emulated board."""

import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from conftest import Boards, Listener, Program, gaps, palpate_json, stamp_errors_ns, wait_until
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import WrenchStamped
from palpate_msgs.msg import Stiffness, Touch
from rclpy.qos import ReliabilityPolicy, qos_profile_sensor_data
from sensor_msgs.msg import Temperature

Start = Callable[..., Program]
Listen = Callable[..., Listener]
Play = Callable[[int], Boards]

OK, WARN, ERROR = b"\x00", b"\x01", b"\x02"


def latest(reports: list[DiagnosticArray], index: int = 0) -> DiagnosticStatus:
    return reports[-1].status[index]


def level(reports: list[DiagnosticArray], index: int = 0) -> bytes | None:
    return latest(reports, index).level if reports else None


def test_forces_of_two_boards_are_complete_in_order_and_stamped(boards: Play, node: Start, listener: Listen) -> None:
    hear = listener()
    forces = [hear.forces(f"/palpate/b{index}/force") for index in range(2)]
    whole = hear.listen(WrenchStamped, "/palpate/b1/force")
    reports = hear.listen(DiagnosticArray, "/diagnostics")
    warm = hear.listen(Temperature, "/palpate/b0/temperature")
    hear.start()
    node(*boards(2).arguments())
    wait_until(lambda: all(forces), 30, "first forces")
    time.sleep(5)
    wait_until(lambda: all(len(of) > 4500 for of in forces), 60, "5 s of forces")
    for of in forces:
        assert set(gaps(of)) == {1}
        errors = [abs(error) for error in stamp_errors_ns(of)]
        # The first exchanges may be long ones, on a computer that has much to do.
        assert max(errors[:1000]) < 20e6 and max(errors[-1000:]) < 0.4e6
    status = latest(reports)
    assert (status.level, status.name) == (OK, "palpate: b0")
    values = {value.key: value.value for value in status.values}
    assert values["records missing"] == values["messages not sent"] == "0"
    largest_ms = 1e-6 * max(abs(error) for error in stamp_errors_ns(forces[0][-1000:]))
    assert largest_ms <= float(values["stamps within (ms)"]) + 0.12, "which grows by that between two exchanges"
    assert whole[0].header.frame_id == "palpate_b1"
    assert {of.wrench.force.x for of in whole} == {0.0}
    assert 0 < warm[0].temperature < 60 and warm[0].variance == 0


def test_a_stiffness_has_the_numbers_of_the_tool(tool: Callable[..., str], recording: str, boards: Play, node: Start, listener: Listen) -> None:
    hear = listener()
    results = hear.listen(Stiffness, "/palpate/b0/stiffness")
    hear.start()
    node(*boards(1).arguments())
    wait_until(lambda: any(of.verdict == Stiffness.MEASURED for of in results), 60, "a stiffness")
    found = next(of for of in results if of.verdict == Stiffness.MEASURED)
    line = palpate_json(tool("measure", "--board", recording, "--json"))
    assert found.stiffness == pytest.approx(line["stiffness_n_per_m"], rel=1e-6)
    assert (found.lower, found.upper) == pytest.approx((line["lower_n_per_m"], line["upper_n_per_m"]), rel=1e-6)
    assert found.force == pytest.approx(line["force_n"], rel=1e-6)
    assert found.standard_error > 0 and found.simulated == line["simulated"] and found.reason == ""
    assert "N/mm" in found.text
    assert found.header.frame_id == "palpate_b0"
    assert math.isnan(found.modulus) and found.modulus_reason == "", "no tip is declared"


def test_a_touch_has_place_force_and_standard_errors(boards: Play, node: Start, listener: Listen) -> None:
    """The played boards send one touch a hundred samples, with these numbers."""
    hear = listener()
    touches = hear.listen(Touch, "/palpate/b0/touch")
    hear.start()
    node(*boards(1).arguments())
    wait_until(lambda: len(touches) >= 4, 30, "touches")
    inside, clear = touches[0], touches[1]
    if inside.verdict != Touch.INSIDE:
        inside, clear = clear, inside
    assert (inside.verdict, clear.verdict) == (Touch.INSIDE, Touch.CLEAR)
    place = [inside.x, inside.y, inside.x_standard_error, inside.y_standard_error]
    assert place == pytest.approx([1.5e-3, -2.5e-3, 2e-5, 3e-5], rel=1e-6)
    assert (inside.force, inside.force_standard_error) == pytest.approx((4.0, 0.08), rel=1e-6)
    assert (inside.radius, inside.radius_standard_error) == pytest.approx((2e-3, 3e-4), rel=1e-6)
    assert (inside.correlation, inside.chi_square) == pytest.approx((0.25, 12.5), rel=1e-6)
    assert math.isnan(clear.x) and math.isnan(clear.force_standard_error)


def test_an_unplugged_board_is_reported_and_comes_back(boards: Play, node: Start, listener: Listen) -> None:
    hear = listener()
    forces = [hear.forces(f"/palpate/b{index}/force") for index in range(2)]
    reports = hear.listen(DiagnosticArray, "/diagnostics")
    hear.start()
    played = boards(2)
    program = node(*played.arguments())
    wait_until(lambda: all(forces), 30, "first forces")
    for _ in range(3):
        played.unplug(1, 1.5)
        wait_until(lambda: level(reports, 1) == ERROR, 20, "the report")
        lost = latest(reports, 1)
        before = len(forces[1])
        wait_until(lambda: len(forces[1]) > before + 100, 30, "forces again")
        wait_until(lambda: level(reports, 1) == OK, 20, "the report")
    assert "palpate serve-emulated" in lost.message or "plug it in again" in lost.message
    assert set(gaps(forces[0])) == {1}, "the other board goes on"
    steps = gaps(forces[1])
    assert min(steps) >= 1 and sum(step > 1 for step in steps) == 3, "in order, and three gaps"
    program.wait_for("plug it in again")
    values = {value.key: value.value for value in latest(reports, 1).values}
    assert values["connections"] == "4" and values["records missing"] == "0"


def test_a_board_that_sends_without_answering_stays_connected(boards: Play, node: Start, listener: Listen) -> None:
    """The node waits 5 s for an answer."""
    hear = listener()
    forces = hear.forces("/palpate/b0/force")
    reports = hear.listen(DiagnosticArray, "/diagnostics")
    hear.start()
    played = boards(1)
    node(*played.arguments())
    wait_until(lambda: len(forces) > 500, 30, "first forces")
    played.mute(0, 7)
    before = len(forces)
    wait_until(lambda: len(forces) > before + 9000, 60, "9 s of forces")
    assert set(gaps(forces)) == {1}
    values = {value.key: value.value for value in latest(reports).values}
    assert values["connections"] == "1" and values["records missing"] == "0"


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_it_ends_when_it_is_asked(how: signal.Signals, boards: Play, node: Start, listener: Listen) -> None:
    hear = listener()
    forces = hear.forces("/palpate/b0/force")
    hear.start()
    played = boards(1)
    program = node(*played.arguments(), "--arm")
    wait_until(lambda: forces, 30, "first forces")
    played.wait_for("arm")
    started = time.monotonic()
    assert program.end(how) == 0, program.lines
    assert time.monotonic() - started < 5
    played.wait_for("disarm")


SUBSCRIBER = """
import sys
sys.path.insert(0, sys.argv[1])
from conftest import Listener, wait_until
from geometry_msgs.msg import WrenchStamped
other = Listener("other")
forces = other.forces("/palpate/b0/force")
other.start()
wait_until(lambda: len(forces) > 200, 60, "forces")
print("receives", flush=True)
import time
time.sleep(60)
"""


def test_a_killed_subscriber_takes_nothing_from_others_and_a_new_one_receives(boards: Play, node: Start, listener: Listen) -> None:
    hear = listener()
    forces = hear.forces("/palpate/b0/force")
    hear.start()
    node(*boards(1).arguments())
    wait_until(lambda: forces, 30, "first forces")
    for _ in range(2):
        command = [sys.executable, "-B", "-c", SUBSCRIBER, str(Path(__file__).parent)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as other:
            assert other.stdout is not None
            assert other.stdout.readline() == "receives\n"
            other.kill()
        before = len(forces)
        wait_until(lambda: len(forces) > before + 1000, 60, "a second more")
    assert set(gaps(forces)) == {1}


def test_names_frames_and_quality_are_those_asked_for(boards: Play, node: Start, listener: Listen) -> None:
    hear = listener(domain=7)
    elsewhere = listener("elsewhere", domain=0)
    missed = elsewhere.listen(WrenchStamped, "/robot1/wrench")
    forces = hear.listen(WrenchStamped, "/robot1/wrench", qos_profile_sensor_data)
    elsewhere.start()
    remap = ["-r", "__ns:=/robot1", "-r", "__node:=finger", "-r", "~/b0/force:=wrench"]
    hear.start()
    node(*boards(1).arguments(), "--best-effort", "--frame-prefix", "tip_", "--ros-args", *remap, ROS_DOMAIN_ID="7")
    wait_until(lambda: forces, 30, "first forces")
    assert forces[0].header.frame_id == "tip_b0"
    info = hear.node.get_publishers_info_by_topic("/robot1/wrench")
    assert [of.qos_profile.reliability for of in info] == [ReliabilityPolicy.BEST_EFFORT]
    wait_until(lambda: ("finger", "/robot1") in hear.node.get_node_names_and_namespaces(), 20, "the node's name")
    topics = dict(hear.node.get_topic_names_and_types())
    assert topics["/robot1/finger/b0/stiffness"] == ["palpate_msgs/msg/Stiffness"]
    assert not missed


def test_a_recording_is_played_to_its_end(recording: str, node: Start, listener: Listen) -> None:
    hear = listener()
    forces = hear.listen(WrenchStamped, "/palpate/press/force")
    hear.start()
    program = node("--board", f"press={recording}")
    assert program.process.wait(timeout=120) == 0, program.lines
    program.wait_for("the recording has ended")
    assert len(forces) > 5000


def test_what_is_wrong_is_named_with_what_to_do(tmp_path: Path) -> None:
    def refused(*arguments: str, **environment: str) -> str:
        command = [os.environ["PALPATE_ROS"], *arguments]
        done = subprocess.run(command, capture_output=True, text=True, env=os.environ | environment, check=False, timeout=60)
        assert done.returncode == 2, done.stderr
        return done.stderr

    assert "two boards are named a" in refused("--board", "a=emulated", "--board", "a=x")
    assert "begins with a letter" in refused("--board", "1=emulated")
    assert "no parameters" in refused("--ros-args", "-p", "rate:=3")
    assert "readable" in refused("--board", f"a={tmp_path}/missing.mcap")
    assert "0..=232" in refused(ROS_DOMAIN_ID="300")
    assert "namespace begins with /" in refused("--namespace", "robot1")
