"""Runs a command; prints its output, then wall time and peak memory of it as one JSON line."""

import json
import resource
import subprocess
import sys
import time

start = time.perf_counter()
done = subprocess.run(sys.argv[1:], stdout=subprocess.PIPE)
wall = time.perf_counter() - start
sys.stdout.buffer.write(done.stdout)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print()
print(json.dumps({"command_s": wall, "peak_MB": used.ru_maxrss / 1024}))
sys.exit(done.returncode)
