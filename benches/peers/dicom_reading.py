#!/usr/bin/env python3
"""Reading of DICOM series by ppa-ct, SimpleITK and pydicom, side by side.

    cargo build --release -p ppa-ct --example read_and_sum
    pip install SimpleITK pydicom pylibjpeg pylibjpeg-libjpeg pylibjpeg-openjpeg pylibjpeg-rle numpy
    benches/peers/dicom_reading.py --slices 128 --rounds 5 SLICE.dcm ...

Each SLICE.dcm, of whole HU, is repeated at other heights to make a series of its encoding. Every reader is a
process of its own that reads the series and sums its voxels; they take turns. Printed are, over the rounds, the
smallest processor time (user and system), the smallest time that passed, and the largest memory. Readers whose
sums differ end the comparison.
"""
import argparse
import os
import pathlib
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
PPA = ROOT / "target/release/examples/read_and_sum"

SIMPLE_ITK = """
import sys, SimpleITK as sitk
reader = sitk.ImageSeriesReader()
reader.SetFileNames(reader.GetGDCMSeriesFileNames(sys.argv[1]))
image = reader.Execute()
print("sum", int(sitk.GetArrayViewFromImage(image).sum(dtype="int64")))
"""

PYDICOM = """
import glob, sys, numpy, pydicom
slices = [pydicom.dcmread(path) for path in glob.glob(sys.argv[1] + "/*")]
slices.sort(key=lambda s: s.ImagePositionPatient[2])
volume = numpy.empty((len(slices), slices[0].Rows, slices[0].Columns), numpy.int16)
for place, s in zip(volume, slices):
    numpy.add(s.pixel_array * int(s.RescaleSlope), int(s.RescaleIntercept), out=place, casting="unsafe")
print("sum", int(volume.sum(dtype="int64")))
"""


def repeat(path, count, folder):
    """Writes `count` copies of a slice, one millimetre apart."""
    import pydicom

    image = pydicom.dcmread(path)
    for n in range(count):
        image.ImagePositionPatient = [*image.ImagePositionPatient[:2], float(n)]
        image.SOPInstanceUID = image.file_meta.MediaStorageSOPInstanceUID = f"2.25.{n + 1}"
        image.InstanceNumber = n + 1
        image.save_as(folder / f"{n:05}.dcm")
    return image.file_meta.TransferSyntaxUID.name


def run(command):
    """Processor seconds, seconds, peak MiB and output of one process."""
    start = time.monotonic()
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        output = process.stdout.read()
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    passed = time.monotonic() - start
    if process.returncode != 0:
        sys.exit(f"{' '.join(command)} failed with exit status {process.returncode}")
    return usage.ru_utime + usage.ru_stime, passed, usage.ru_maxrss / 1024, output


def main():
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("slices_to_repeat", nargs="+", metavar="SLICE.dcm")
    arguments.add_argument("--slices", type=int, default=512)
    arguments.add_argument("--rounds", type=int, default=5)
    options = arguments.parse_args()
    readers = {
        "ppa-ct": [str(PPA)],
        "SimpleITK": [sys.executable, "-c", SIMPLE_ITK],
        "pydicom": [sys.executable, "-c", PYDICOM],
    }
    # What an interpreter costs before it reads anything is taken off.
    imports = {"SimpleITK": "SimpleITK", "pydicom": "numpy, pydicom, pydicom.pixels.decoders"}
    idle = {"ppa-ct": [0.0, 0.0]}
    for name, modules in imports.items():
        starts = [run([sys.executable, "-c", f"import {modules}"])[:2] for _ in range(3)]
        idle[name] = [min(times) for times in zip(*starts)]
    for path in options.slices_to_repeat:
        with tempfile.TemporaryDirectory() as folder:
            encoding = repeat(path, options.slices, pathlib.Path(folder))
            print(f"{encoding}, {options.slices} slices")
            found = {name: [] for name in readers}
            for _ in range(options.rounds):
                for name, command in readers.items():
                    found[name].append(run([*command, folder]))
            sums = {r[3].split()[1].rstrip(",") for rounds in found.values() for r in rounds}
            if len(sums) > 1:
                sys.exit(f"the readers' sums differ: {sums}")
            for name, rounds in found.items():
                processor, passed = [min(r[n] for r in rounds) - idle[name][n] for n in (0, 1)]
                memory = max(r[2] for r in rounds)
                print(f"  {name:10} {processor:6.2f} s processor {passed:6.2f} s {memory:6.0f} MiB")


if __name__ == "__main__":
    main()
