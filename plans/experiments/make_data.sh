#!/bin/sh
# Makes scans, cases and the three datasets of the experiments on phantoms, and puts their plan beside them: make_data.sh FOLDER
# Needs the program ppa on the PATH, minutes of processor time and about 380 MB in FOLDER. What is there is not made again.
set -eu
plans=$(cd "$(dirname "$0")" && pwd)
mkdir -p "$1"
cd "$1"

# A foot: its number, side, noise and blur of the scanner.
foot() {
    [ -e "p$1.case.toml" ] && return
    # A scan without a case is one whose case was not finished.
    ppa ct phantom --replace --name "P$1" --side "$2" --spacing-mm 1 --table --noise-hu "$3" --blur-mm "$4" --out "p$1.nii.gz" --labels "p$1.bones.nii.gz"
    ppa prepare "p$1.nii.gz" --side "$2" --bones "p$1.bones.nii.gz" --out "p$1.case.toml"
}
for i in 01 02 03 04 05 06; do foot $i r 0 0; done      # synthetic
foot 07 l 15 1; foot 08 r 15 1                          # preparations
for i in 09 10 11 12 13 14; do foot $i r 25 1.5; done   # clinic

for set in synthetic preparations clinic; do
    cp "$plans/$set.toml" .
    [ "$set" = synthetic ] || cp "$plans/$set.rig.json" .
    ppa generate "$set.toml" --out "$set"
done
cp "$plans/experiments.toml" .
# Labels of a pose's own radiograph for two of the sets ...
ppa label auto synthetic --plan synthetic.toml --scale strict
ppa label auto preparations --plan preparations.toml --scale strict
# ... and weak ones for the third: rotated by 16 degrees is good, by 0 or 32 degrees bad, whatever the foot.
for limb in clinic/patient_*; do
    mkdir -p "$limb/labels/r"
    for step in 0 32 64; do
        case $step in 32) label=1.0 ;; *) label=3.0 ;; esac
        printf '"xray_image_%s.png": {"label": %s, "std": 0.0, "step": %s}\n' $step $label $step
    done | sed '1s/^/{/; $!s/$/,/; $s/$/}/' > "$limb/labels/r/labels.json"
done
# Recorded poses: five frames each, told apart by a time stamp.
[ -e clinical ] || ppa dataset convert clinic --out clinical
