#!/usr/bin/env bash
# Fuzzes the targets of this folder one after the other, led by coverage, with integer overflow and debug assertions checked.
#
#   bash fuzz/run.sh [SECONDS] [TARGET...]     default: 600 seconds each of all six
#
# Installs cargo-fuzz where it is missing, and needs a nightly toolchain (`rustup toolchain install nightly`). Corpus and
# findings stay in fuzz/corpus and fuzz/artifacts; a finding is run again with
# `cargo +nightly fuzz run --sanitizer none TARGET FILE`.
# INNOVANT_FUZZ_SANITIZER=address looks into dependencies too (nothing here is `unsafe`); it takes much longer to build.
set -euo pipefail
cd "$(dirname "$0")/.."

seconds=600
if [[ ${1:-} =~ ^[0-9]+$ ]]; then
    seconds=$1
    shift
fi
targets=("$@")
if [[ ${#targets[@]} -eq 0 ]]; then
    targets=(csv_reader model_json explanation_json plant_text identify explain)
fi

# What a target may hold is bounded by its allocator (bound.rs). On top come code, corpus and coverage of libFuzzer.
allocations_mb=256
process_mb=1024

if ! cargo fuzz --version >/dev/null 2>&1; then
    cargo install cargo-fuzz --locked
fi

# Longest time that one input may take, in seconds: a hundred times what it takes without instrumentation, and more for a
# log that is explained, where that is a second. The slowest log known takes 4 s to identify, and 23 s with instrumentation.
declare -A longest=([csv_reader]=10 [model_json]=10 [explanation_json]=20 [plant_text]=30 [identify]=60 [explain]=120)

# One thread: what is found is found again.
export RAYON_NUM_THREADS=1
for target in "${targets[@]}"; do
    echo "$target: $seconds s"
    # The bytes are choices, of which a log takes a hundred: inputs are long from the start.
    corpus=fuzz/corpus/$target
    mkdir -p "$corpus"
    for i in {1..60}; do
        [[ -e $corpus/start_$i ]] || head -c 220 /dev/urandom >"$corpus/start_$i"
    done
    # Random bytes hardly ever become a plant.
    if [[ $target == plant_text ]]; then
        cp data/plants/*.mo "$corpus"
    fi
    cargo +nightly fuzz run "$target" --sanitizer "${INNOVANT_FUZZ_SANITIZER:-none}" -- \
        -max_total_time="$seconds" -timeout="${longest[$target]}" -max_len=4096 -len_control=0 \
        -rss_limit_mb=$process_mb -malloc_limit_mb=$allocations_mb -print_final_stats=1
done
