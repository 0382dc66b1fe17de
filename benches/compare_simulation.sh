#!/usr/bin/env bash
# State updates per second of innovant, diffsol and scipy on one plant, one after the other on one thread.
#
#   bash benches/compare_simulation.sh [PYTHON]     a Python with scipy; default: python3
set -euo pipefail
cd "$(dirname "$0")/.."
cargo bench --bench simulation
cargo run --release --manifest-path benches/diffsol/Cargo.toml
"${1:-python3}" benches/simulation_scipy.py
