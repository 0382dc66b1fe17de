#!/usr/bin/env bash
# CPU time and peak memory of `innovant identify` on a long CSV against `pandas.read_csv` of the same file, in
# one run. Usage: bash benches/compare_pandas.sh [samples, default 1000000]
set -euo pipefail
cd "$(dirname "$0")/.."
samples=${1:-1000000}
cargo build --release --example long_log --bin innovant 2>/dev/null
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
./target/release/examples/long_log "$samples" > "$folder/log.csv"
python3 - "$folder/log.csv" "$folder/model.json" <<'PY'
import os, resource, subprocess, sys

log, model = sys.argv[1:]
pandas = [sys.executable, "-c", "import pandas,sys,time\nt=time.process_time()\npandas.read_csv(sys.argv[1])\nprint(time.process_time()-t)", log]


def cpu(command):
    """CPU seconds (user and system) and peak memory in MB of a process."""
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    assert status == 0, command
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


print(f"{os.path.getsize(log) / 1e6:.0f} MB CSV")
reading = min(float(subprocess.check_output(pandas)) for _ in range(5))
print(f"pandas.read_csv alone         {reading:.3f} CPU s")
for extra in (["--past", "20"], ["--past", "100"], []):
    runs = [cpu(["./target/release/innovant", "identify", log, "-q", "--output", model, *extra]) for _ in range(5)]
    seconds = min(r[0] for r in runs)
    print(f"innovant identify {' '.join(extra):<12}{seconds:.3f} CPU s   {seconds / reading:.2f} times pandas   {max(r[1] for r in runs):.0f} MB")
PY
