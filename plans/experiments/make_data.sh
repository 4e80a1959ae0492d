#!/bin/sh
# Makes scans, cases and the three datasets of the experiments on phantoms, and copies their plan next to them: make_data.sh
# FOLDER. Needs the program ppa on the PATH, forty minutes of processor time and about 3 GB in FOLDER. Existing files are not made again.
set -eu
plans=$(cd "$(dirname "$0")" && pwd)

# Makes the scan and the case of a foot from its name, its number and options of its phantom and scanner. Odd numbers are right feet,
# even ones left.
make_foot() {
    foot=$1; number=$2; shift 2
    side=$([ $((number % 2)) = 1 ] && echo r || echo l)
    # A scan without a case is from an interrupted run.
    [ ! -e "$foot.case.toml" ] || return 0
    ppa ct phantom --replace --side "$side" --spacing-mm 1 --table "$@" --out "$foot.nii.gz" --labels "$foot.bones.nii.gz"
    ppa prepare "$foot.nii.gz" --side "$side" --bones "$foot.bones.nii.gz" --out "$foot.case.toml"
}
if [ "${1:?expected a folder}" = --foot ]; then
    shift
    make_foot "$@"
    exit
fi

mkdir -p "$1"
cd "$1"

# Adds a foot to the dataset, with the arguments of make_foot.
foot() {
    echo "$*" >> "$set.feet"
    printf '\n[[case]]\nfile = "%s.case.toml"\npatient = %s\n' "$1" "$2" >> "$set.toml.part"
}

# Makes a dataset: the plan with its feet, made in parallel, one per processor, and its images.
begin() { set=$1; cp "$plans/$set.toml" "$set.toml.part"; : > "$set.feet"; }
finish() {
    xargs -P "$(getconf _NPROCESSORS_ONLN)" -L 1 "$plans/make_data.sh" --foot < "$set.feet"
    rm "$set.feet"
    mv "$set.toml.part" "$set.toml"
    [ "$set" = synthetic ] || cp "$plans/$set.rig.json" .
    ppa generate "$set.toml" --out "$set"
}

begin synthetic # 17 feet of the table and 73 of the population
for n in 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17; do foot "p$n" $n --name "$(printf P%02d $n)"; done
for n in $(seq 101 173); do foot "p$n" "$n" --seed "$n"; done
finish
begin preparations
for n in 201 202 203 204; do foot "p$n" $n --seed $n --noise-hu 15 --blur-mm 1; done
finish
begin clinic
for n in 301 302 303 304 305 306; do foot "p$n" $n --seed $n --noise-hu 25 --blur-mm 1.5; done
finish
cp "$plans/experiments.toml" .

# Labels from the bones in the pose for two of the sets ...
ppa label auto synthetic --plan synthetic.toml
ppa label auto preparations --plan preparations.toml
# ... and weak ones for the third: rotation by 18 degrees is good, by 0 or 36 degrees bad, for every foot.
for limb in clinic/patient_*; do
    for side in l r; do
        [ -d "$limb/depth/$side" ] || continue
        mkdir -p "$limb/labels/$side"
        for step in 0 36 72; do
            case $step in 36) label=1.0 ;; *) label=3.0 ;; esac
            printf '"xray_image_%s.png": {"label": %s, "std": 0.0, "step": %s}\n' $step $label $step
        done | sed '1s/^/{/; $!s/$/,/; $s/$/}/' > "$limb/labels/$side/labels.json"
    done
done
# Recorded poses: five frames each, distinguished by a time stamp.
[ -e clinical ] || ppa dataset convert clinic --out clinical
