#!/usr/bin/env bash
# Writes a page of every kind and opens each in a real browser (check.py says what is looked at).
# Usage: tests/pages/run.sh [FOLDER]; with a folder, pages, screenshots and printed pages stay there.
set -euo pipefail
cd "$(dirname "$0")/../.."

command -v chromium >/dev/null || command -v chromium-browser >/dev/null || command -v google-chrome >/dev/null || {
    apt-get update -qq && apt-get install -y -qq chromium
}
program=${INNOVANT:-}
if [ -z "$program" ]; then
    cargo build --release --bin innovant
    program=${CARGO_TARGET_DIR:-target}/release/innovant
fi
folder=${1:-}
if [ -z "$folder" ]; then
    folder=$(mktemp -d)
    trap 'rm -rf "$folder"' EXIT
fi
mkdir -p "$folder"

innovant() { "$program" --quiet "$@"; }

innovant identify data/closed_loop.csv --report "$folder/identify.html"
innovant identify data/servo.csv --inputs voltage --outputs speed --report "$folder/identify-servo.html"
innovant identify data/closed_loop.csv --order 1 --report "$folder/identify-rejected.html"
# Names that would do harm if they were not escaped.
sed '1s/.*/t,"u<script>alert(1)<\/script>","u<img src=x onerror=alert(2)>","y<a href=""javascript:alert(3)"">z<\/a>","y\&amp;<b>"/' \
    data/closed_loop.csv > "$folder/names.csv"
innovant identify "$folder/names.csv" --inputs 'u<script>alert(1)</script>,u<img src=x onerror=alert(2)>' \
    --outputs 'y<a href="javascript:alert(3)">z</a>,y&amp;<b>' --report "$folder/identify-names.html"

for case in ${CASES:-001 004}; do
    at=data/concealed/case_$case
    simulation=$at/simulation.csv
    [ -f "$simulation" ] || simulation=$at/simulation.json
    innovant explain "$at/recording.csv" --simulation "$simulation" --report "$folder/explain-$case.html"
done

innovant reproduce ${EXPERIMENTS:-van-wingerden-1 chiuso-picci-1} --runs "${RUNS:-8}" --output-dir "$folder"

python3 tests/pages/check.py "$folder"/*.html ${1:+--pictures "$folder/pictures"}
