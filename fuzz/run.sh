#!/usr/bin/env bash
# Runs all fuzz targets, or those named, for some seconds each (default 5): fuzz/run.sh 60, fuzz/run.sh 60 nifti mesh.
#
# Builds and runs them like `cargo fuzz run -s none TARGET`, but with the stable compiler and without cargo-fuzz. Crashing inputs
# are written to fuzz/artifacts. Needs a C++ compiler for libFuzzer.
set -euo pipefail
cd "$(dirname "$0")"

seconds=${1:-5}
shift || true
targets=("$@")
if [ ${#targets[@]} -eq 0 ]; then
    for file in fuzz_targets/*.rs; do targets+=("$(basename "$file" .rs)"); done
fi

# Coverage of edges and comparisons, with the options of cargo-fuzz.
coverage="-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
-Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table \
-Cllvm-args=-sanitizer-coverage-trace-compares --cfg fuzzing -Ccodegen-units=16"
# With an explicit target, build scripts run without the fuzzer.
host=$(rustc -vV | sed -n 's/^host: //p')
RUSTFLAGS=$coverage cargo build --release --locked --bins --target "$host"
bin=target/$host/release

corpus=$(mktemp -d)
trap 'rm -rf "$corpus"' EXIT
export TMPDIR=$corpus/files
mkdir -p "$TMPDIR" artifacts
cargo run --quiet --locked --manifest-path ../Cargo.toml --example fuzz_seeds -- "$corpus"
# Runs a target and prints what it did, or the end of its log.
fuzz() {
    mkdir -p "$corpus/$1"
    # One thread each: every file would have to wait for the threads of a pool.
    RAYON_NUM_THREADS=1 "$bin/$1" "$corpus/$1" -max_total_time="$seconds" -timeout=20 \
        -rss_limit_mb=1024 -malloc_limit_mb=1024 -max_len=4096 -artifact_prefix="artifacts/$1-" -print_final_stats=1 \
        >"$corpus/$1.log" 2>&1 || { tail -n 60 "$corpus/$1.log"; return 1; }
    awk -v target="$1" '/number_of_executed_units/ { runs = $2 } /peak_rss_mb/ { rss = $2 }
        END { printf "%-12s %8d files, at most %d MiB\n", target, runs, rss }' "$corpus/$1.log"
}
export -f fuzz
export bin corpus seconds
printf '%s\n' "${targets[@]}" | xargs -P "$(nproc)" -I{} bash -c 'fuzz {}'
