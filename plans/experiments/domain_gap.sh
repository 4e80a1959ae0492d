#!/bin/sh
# Effect of moved cameras and sensor errors: networks trained with the source (`ppa experiment 2a`), tested without finetuning on the feet
# of the simulated preparations, with and without both. domain_gap.sh FOLDER, that of make_data.sh with the training runs in FOLDER/runs.
set -eu
cd "$1"

for set in neither cameras sensor; do
    if [ ! -e "$set.labelled" ]; then
        case $set in
            neither) sed '/^rig/d; /^\[depth/,/^$/d' preparations.toml ;;
            cameras) sed '/^\[depth.sensor/,/^$/d' preparations.toml ;;
            sensor) sed '/^rig/d' preparations.toml ;;
        esac > "$set.toml"
        ppa generate "$set.toml" --out "$set"
        ppa label auto "$set" --plan "$set.toml"
        touch "$set.labelled"
    fi
done
echo "set,seed,camera,mae,spearman"
for set in neither cameras sensor preparations; do
    for run in runs/pretraining/size/cam_*/seed_*; do
        camera=$(basename "$(dirname "$run")")
        seed=${run##*_}
        mkdir -p "evaluations/$set/$camera"
        out=evaluations/$set/$camera/seed_$seed
        ppa eval "$run" --dataset "$set" --out "$out" --replace --json > "$out.json"
        grep -o '"images":{[^}]*}' "$out.json" |
            sed "s/.*\"mae\":\([^,]*\),\"spearman\":\([^,]*\).*/$set,$seed,$camera,\1,\2/"
    done
done
