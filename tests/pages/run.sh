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

# Plants in equations: one output, two outputs, and one that is not determined.
for plant in tanks motor; do
    innovant identify data/plants/$plant.csv --structure data/plants/$plant.mo --report "$folder/plant-$plant.html"
done
innovant identify data/plants/pendulum.csv --structure data/plants/pendulum.mo --report "$folder/plant-pendulum.html"

# One of each answer: effects with a simulation as columns and as a model, nothing missing, other parameters, and what
# is left when the library lacks the truth.
cases=data/concealed
innovant explain $cases/case_001/recording.csv --simulation $cases/case_001/simulation.csv \
    --report "$folder/explain-named.html"
innovant explain $cases/case_004/recording.csv --simulation $cases/case_004/simulation.json \
    --report "$folder/explain-freeze.html"
innovant explain $cases/case_009/recording.csv --simulation $cases/case_009/simulation.json \
    --report "$folder/explain-consistent.html"
python3 - $cases/case_009/simulation.json "$folder/other_gain.json" <<'PYTHON'
import json, sys
model = json.load(open(sys.argv[1]))
model["B"] = [[1.1 * value for value in row] for row in model["B"]]
json.dump(model, open(sys.argv[2], "w"))
PYTHON
innovant explain $cases/case_009/recording.csv --simulation "$folder/other_gain.json" \
    --report "$folder/explain-parameters.html"
innovant explain $cases/case_006/recording.csv --simulation $cases/case_006/simulation.csv \
    --without coulomb_friction,stribeck_friction,hysteresis --report "$folder/explain-unexplained.html"

innovant reproduce ${EXPERIMENTS:-van-wingerden-1 chiuso-picci-1 knudsen-vo} --runs "${RUNS:-8}" --output-dir "$folder"

python3 tests/pages/check.py "$folder"/*.html ${1:+--pictures "$folder/pictures"}
