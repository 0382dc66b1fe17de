#!/usr/bin/env bash
# State updates per second of innovant, scipy and diffsol on one plant, one after the other on one thread.
#
#   bash benches/compare_simulation.sh [PYTHON]     a Python with scipy; default: python3
set -euo pipefail
cd "$(dirname "$0")/.."
cargo bench --bench simulation
"${1:-python3}" benches/simulation_scipy.py
cargo run --release --quiet --manifest-path benches/diffsol/Cargo.toml
