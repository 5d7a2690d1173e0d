"""Latency and losses of the node at full load, beside a bare publisher of the same messages.

`measure.py boards 8 60` or `measure.py bare 8 60`, each in a network of its own, with the variables of conftest.py:
RECORDING names what the boards play. `--unplug N` unplugs boards in turn while it measures; a gap is explained by an
unplug of its board between the samples on both its sides.
"""

import argparse
import os
import resource
import time

from conftest import Boards, Force, Listener, Program, gaps, stamp_errors_ns, true_times_ns, wait_until

# Largest error of the first stamps, and of the time at which a board takes the order to be unplugged.
TOLERANCE_NS = 20_000_000


def at_unplugs(forces: list[Force], unplugs_ns: list[int]) -> int:
    """Unplugs with a gap; each has one at most."""
    spans = [
        (before, after)
        for step, (before, _, _), (after, _, _) in zip(gaps(forces), forces, forces[1:])
        if step > 1
    ]
    return sum(
        any(before - TOLERANCE_NS <= at <= after for before, after in spans) for at in unplugs_ns
    )


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("what", choices=["boards", "bare"])
    parser.add_argument("count", type=int)
    parser.add_argument("seconds", type=int)
    parser.add_argument("--unplug", type=int, default=0)
    asked = parser.parse_args()
    listener = Listener()
    forces = [listener.forces(f"/palpate/b{index}/force") for index in range(asked.count)]
    listener.start()
    if asked.what == "bare":
        # Longer than it is measured, for the discovery.
        number = [str(of) for of in [asked.count, 1000, asked.seconds + 30]]
        program = Program(os.environ["BARE_PUBLISHER"], *number)
    else:
        boards = Boards(os.environ["RECORDING"], asked.count)
        program = Program(os.environ["PALPATE_ROS"], *boards.arguments())
    wait_until(lambda: all(forces), 120, "first forces")
    # With the last force before the measurement: an unplug may come before the next one.
    started = [len(of) - 1 for of in forces]
    unplugs_ns: list[list[int]] = [[] for _ in forces]
    for index in range(asked.unplug):
        unplugs_ns[index % asked.count].append(time.time_ns())
        boards.unplug(index % asked.count, 0.5)
        time.sleep(asked.seconds / asked.unplug)
    if asked.unplug:
        end_ns = time.time_ns()
        wait_until(lambda: all(of[-1][0] > end_ns for of in forces), 120, "the forces until now")
    else:
        time.sleep(asked.seconds)
    ended = [len(of) for of in forces]
    load = os.getloadavg()[0]
    program.end()
    parts = [of[first:last] for of, first, last in zip(forces, started, ended)]
    steps = [step for part in parts for step in gaps(part)]
    latencies = sorted(
        arrived - true for part in parts for (_, arrived, _), true in zip(part, true_times_ns(part))
    )
    errors = sorted(abs(error) for part in parts for error in stamp_errors_ns(part))

    def ms(values: list[int], share: float) -> str:
        return f"{values[int(share * (len(values) - 1))] * 1e-6:.3f} ms"

    lost = sum(step - 1 for step in steps if step > 1)
    jumps = sum(step > 1 for step in steps)
    print(f"{asked.what}: {len(latencies)} messages of {asked.count} topics in {asked.seconds} s; load {load:.0f}")
    print(f"lost {lost} in {jumps} gaps, out of order {sum(step < 1 for step in steps)}")
    if asked.unplug:
        count = sum(at_unplugs(part, at) for part, at in zip(parts, unplugs_ns))
        print(f"{asked.unplug} unplugs: {count} with a gap; {jumps - count} gaps without an unplug")
    print(f"latency: median {ms(latencies, 0.5)}, 99 % {ms(latencies, 0.99)}, longest {ms(latencies, 1)}")
    if asked.what == "boards":
        print(f"error of stamps: median {ms(errors, 0.5)}, 99 % {ms(errors, 0.99)}, largest {ms(errors, 1)}")
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(f"processor time of the publisher: {used.ru_utime + used.ru_stime:.1f} s")
    os._exit(0)


if __name__ == "__main__":
    main()
