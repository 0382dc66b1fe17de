#!/usr/bin/env python3
"""What `innovant` takes under load: CPU time and peak memory of the command alone, without what makes the recordings.

    python3 benches/load.py long      1e5 .. 1e8 samples through standard input (3.6 GB at 1e8, never on disk)
    python3 benches/load.py wide      16 inputs and 16 outputs, past window 50
    python3 benches/load.py many      a batch of 10 000 small logs, and the same again when all are there

Numbers after the name replace the sizes: `load.py long 100000 1000000`. Builds what it needs; INNOVANT and LONG_LOG name
binaries that are there already. Needs Linux or macOS, and nothing but Python's standard library.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def binaries():
    given = [os.environ.get("INNOVANT"), os.environ.get("LONG_LOG")]
    if not all(given):
        build = ["cargo", "build", "--release", "--quiet", "--bin", "innovant", "--example", "long_log"]
        subprocess.run(build, cwd=ROOT, check=True)
        target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "release"
        given = [target / "innovant", target / "examples" / "long_log"]
    return [str(path) for path in given]


INNOVANT, LONG_LOG = binaries()


def run(arguments, source=None):
    """CPU seconds and peak memory in MB of one run of innovant, which must end well."""
    maker = source and subprocess.Popen([LONG_LOG, *source], stdout=subprocess.PIPE)
    # Not subprocess: the child would count the memory of this process, from which it is forked.
    files = [(os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0)]
    if maker:
        files.append((os.POSIX_SPAWN_DUP2, maker.stdout.fileno(), 0))
    child = os.posix_spawn(INNOVANT, [INNOVANT, *arguments], os.environ, file_actions=files)
    if maker:
        maker.stdout.close()
    _, status, used = os.wait4(child, 0)
    if maker and maker.wait() != 0 or status != 0:
        sys.exit(f"innovant {' '.join(arguments)} ended with {os.waitstatus_to_exitcode(status)}")
    unit = 1 if sys.platform == "darwin" else 1024
    return used.ru_utime + used.ru_stime, used.ru_maxrss * unit / 1e6


def long(sizes):
    print("| samples | CPU s | ns a sample | peak memory |\n|---|---|---|---|")
    for samples in sizes or [10**5, 10**6, 10**7, 10**8]:
        cpu, peak = run(["identify", "-", "-q"], [str(samples), "1", "4"])
        print(f"| {samples:.0e} | {cpu:.2f} | {cpu / samples * 1e9:.0f} | {peak:.0f} MB |", flush=True)


def wide(sizes):
    print("| request | CPU s | peak memory |\n|---|---|---|")
    for samples in sizes or [20_000, 200_000]:
        for order in ["4", "16", "auto"]:
            arguments = ["identify", "-", "-q", "--past", "50", "--order", order]
            cpu, peak = run(arguments, [str(samples), "8", "4"])
            print(f"| {samples} samples, order {order} | {cpu:.1f} | {peak:.0f} MB |", flush=True)


def many(sizes):
    print("| batch | CPU s | ms a log | peak memory |\n|---|---|---|---|")
    for count in sizes or [1000, 10_000]:
        with tempfile.TemporaryDirectory() as folder:
            logs = Path(folder, "logs")
            logs.mkdir()
            text = subprocess.run([LONG_LOG, str(count * 10 + 500), "1", "4"], capture_output=True, check=True).stdout
            header, *rows = text.splitlines()
            # Each log is 500 samples of one recording, 10 later than the one before.
            names = []
            for index in range(count):
                names.append(str(logs / f"{index:05}.csv"))
                Path(names[-1]).write_bytes(b"\n".join([header, *rows[index * 10 : index * 10 + 500], b""]))
            arguments = ["batch", "-q", "--output-dir", str(Path(folder, "models")), *names]
            for what in ["identified", "all there already"]:
                cpu, peak = run(arguments)
                print(f"| {count} logs, {what} | {cpu:.1f} | {cpu / count * 1e3:.2f} | {peak:.0f} MB |", flush=True)


if __name__ == "__main__":
    studies = {"long": long, "wide": wide, "many": many}
    if len(sys.argv) < 2 or sys.argv[1] not in studies:
        sys.exit(__doc__)
    studies[sys.argv[1]]([int(float(size)) for size in sys.argv[2:]])
