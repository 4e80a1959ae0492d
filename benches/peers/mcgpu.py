#!/usr/bin/env python3
"""Histories per processor second of MC-GPU v1.3 on a CPU and of `ppa xray mcgpu`, in turn on one input file.

    cargo build --release -p ppa-cli
    git clone https://github.com/DIDSR/MCGPU    # its README says how to build it without CUDA
    gcc -x c -std=gnu89 -O3 -ffast-math -ftree-vectorize -funroll-loops ...
    benches/peers/mcgpu.py EXECUTABLE INPUT.in [ROUNDS]
    benches/peers/mcgpu.py EXECUTABLE FOLDER [ROUNDS]

Paths in INPUT.in must be absolute. FOLDER holds phantom, spectrum and material files of case a (../shared/reference/xray). Of MC-GPU
the preparation is left out: its rate is that of the histories by which a run exceeds one of a quarter as many. That of ppa counts
everything.
"""
import processor_time

import pathlib
import re
import statistics
import sys
import tempfile

PPA = pathlib.Path(__file__).resolve().parents[2] / "target/release/ppa"
MCGPU_HISTORIES, PPA_HISTORIES = 4_000_000, 10_000_000
MATERIALS = ("air", "soft_tissue_icrp", "bone_cortical_icrp", "titanium", "water")

CASE_A = """#[SECTION SIMULATION CONFIG v.2009-05-12]
4e6                       # HISTORIES
1234567890                # RANDOM SEED
0                         # GPU NUMBER
128                       # GPU THREADS PER CUDA BLOCK
150                       # HISTORIES PER GPU THREAD
#[SECTION SOURCE v.2011-07-12]
{folder}/spectrum_60kVp.spc # SPECTRUM
10.0 -85.0 10.0           # SOURCE POSITION, cm
0.0 1.0 0.0               # SOURCE DIRECTION
-15.0 -15.0               # APERTURES: those of the detector
#[SECTION IMAGE DETECTOR v.2009-12-02]
image.dat                 # OUTPUT IMAGE
300 300                   # PIXELS
30.0 30.0                 # SIZE, cm
110.0                     # SOURCE TO DETECTOR, cm
#[SECTION CT SCAN TRAJECTORY v.2011-10-25]
1                         # PROJECTIONS
0.0                       # ANGLE BETWEEN PROJECTIONS
0.0 360.0                 # ANGLES OF INTEREST
95.0                      # SOURCE TO ROTATION AXIS, cm
0.0                       # VERTICAL TRANSLATION
#[SECTION DOSE DEPOSITION v.2012-12-12]
NO                        # MATERIAL DOSE
NO                        # VOXEL DOSE
dose.dat                  # OUTPUT DOSE
1 1                       # X
1 1                       # Y
1 1                       # Z
#[SECTION VOXELIZED GEOMETRY FILE v.2009-11-30]
{folder}/phantom_a.vox.gz # GEOMETRY
#[SECTION MATERIAL FILE LIST v.2009-11-30]
{materials}
"""


def case_a(folder):
    folder = pathlib.Path(folder).resolve()
    files = (f"{folder}/materials_mcgpu/{name}__5-120keV.xrl.mcgpu.gz #" for name in MATERIALS)
    return CASE_A.format(folder=folder, materials="\n".join(files))


def with_histories(text, histories):
    """The first line of the first section is the number of histories."""
    return re.sub(r"(SECTION SIMULATION CONFIG.*\n)\s*\S+", rf"\g<1>{histories}", text, count=1)


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    program = pathlib.Path(sys.argv[1]).resolve()
    given = pathlib.Path(sys.argv[2])
    text = case_a(given) if given.is_dir() else given.read_text()
    rounds = int(sys.argv[3]) if len(sys.argv) > 3 else 3

    ratios = []
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder, "measured.in")
        for number in range(rounds):
            seconds = []
            for histories in (MCGPU_HISTORIES // 4, MCGPU_HISTORIES):
                file.write_text(with_histories(text, histories))
                seconds.append(processor_time.of_program([program, file.name], cwd=folder)[0])
            theirs = 0.75 * MCGPU_HISTORIES / (seconds[1] - seconds[0])
            command = [PPA, "--threads", "1", "xray", "mcgpu", file]
            command += ["--histories", str(PPA_HISTORIES), "--out", f"{folder}/{number}"]
            ours = PPA_HISTORIES / processor_time.of_program(command)[0]
            ratios.append(ours / theirs)
            print(f"MC-GPU {theirs / 1e6:.2f} M/s, ppa {ours / 1e6:.2f} M/s, ratio {ratios[-1]:.1f}")
    print(f"median ratio {statistics.median(ratios):.1f}")


if __name__ == "__main__":
    main()
