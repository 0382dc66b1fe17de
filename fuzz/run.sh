#!/usr/bin/env bash
# Fuzzes the targets of this folder one after the other, under the address sanitizer and led by coverage.
#
#   bash fuzz/run.sh [SECONDS] [TARGET...]     default: 600 seconds each of all five
#
# Installs cargo-fuzz where it is missing, and needs a nightly toolchain (`rustup toolchain install nightly`). Corpus and
# findings stay in fuzz/corpus and fuzz/artifacts; a finding is run again with `cargo +nightly fuzz run TARGET FILE`.
# INNOVANT_FUZZ_SANITIZER=none builds faster, but then no single allocation is bounded.
set -euo pipefail
cd "$(dirname "$0")/.."

seconds=600
if [[ ${1:-} =~ ^[0-9]+$ ]]; then
    seconds=$1
    shift
fi
targets=("$@")
if [[ ${#targets[@]} -eq 0 ]]; then
    targets=(csv_reader model_json explanation_json identify explain)
fi

# The inputs are at most 4 KB, and what they stand for is at most 2 MB of text or 200 samples of 4 channels. What they may
# ask for is bounded by the automatic limits of the windows: moments of 250 lags of 4 channels, whose Gram matrix takes
# (251 x 4)^2 x 8 bytes = 8 MB, and a few of it at once.
largest_allocation_mb=256
# All of them together, with the sanitizer's shadow and quarantine.
memory_mb=2048

if ! cargo fuzz --version >/dev/null 2>&1; then
    cargo install cargo-fuzz --locked
fi

# A log that is explained takes a second without the sanitizer, ten with it.
declare -A longest=([csv_reader]=10 [model_json]=10 [explanation_json]=20 [identify]=30 [explain]=120)

# One thread: what is found is found again.
export RAYON_NUM_THREADS=1
for target in "${targets[@]}"; do
    echo "$target: $seconds s"
    cargo +nightly fuzz run "$target" --sanitizer "${INNOVANT_FUZZ_SANITIZER:-address}" -- \
        -max_total_time="$seconds" -timeout="${longest[$target]}" -max_len=4096 \
        -rss_limit_mb=$memory_mb -malloc_limit_mb=$largest_allocation_mb \
        -jobs=0 -print_final_stats=1
done
