"""Builds palpate_msgs with the generators of ROS 2: `build_messages.py SOURCE BUILD INSTALL`.

The wheels of ROS 2 name folders of the machine that made them. Those are replaced by this environment's.
"""

import os
import subprocess
import sys
import sysconfig
from pathlib import Path


def correct(environment: Path) -> None:
    """Replaces foreign folders in the CMake files of the environment."""
    here = {
        "include/python3.11": sysconfig.get_paths()["include"],
        "lib/python3.11/site-packages": sysconfig.get_paths()["purelib"],
    }
    for file in environment.glob("share/*/cmake/*.cmake"):
        text = file.read_text()
        corrected = text
        for foreign, folder in here.items():
            corrected = corrected.replace(f"/opt/python/cp311-cp311/{foreign}", folder)
        if corrected != text:
            file.write_text(corrected)


def main() -> None:
    source, build, install = sys.argv[1:]
    environment = Path(sys.prefix)
    correct(environment)
    programs = environment / "bin"
    variables = os.environ | {
        "AMENT_PREFIX_PATH": str(environment),
        "CMAKE_PREFIX_PATH": str(environment),
        "PATH": f"{programs}:{os.environ['PATH']}",
        "LD_LIBRARY_PATH": str(environment / "lib"),
    }

    def run(*command: str) -> None:
        done = subprocess.run(command, env=variables, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            sys.exit(f"{' '.join(command)}:\n{done.stdout[-4000:]}\n{done.stderr[-4000:]}")

    configure = ["-G", "Ninja", "-S", source, "-B", build, f"-DCMAKE_INSTALL_PREFIX={install}"]
    run("cmake", *configure, f"-DPython3_EXECUTABLE={sys.executable}", "-DBUILD_TESTING=OFF")
    run("ninja", "-C", build, "install")


if __name__ == "__main__":
    main()
