#!/usr/bin/env python3
"""Tabulate unfiltered tungsten-anode spectra for ppa-xray.

    python -m venv venv && venv/bin/pip install spekpy==2.5.4
    venv/bin/python ppa-xray/scripts/make_spectra.py

Source: SpekPy 2.5.4 (MIT), physics model `casim`, constant potential, without any
filtration, on the central axis at 1 m, per mAs and cm2. The bremsstrahlung is kept apart
from the characteristic lines so that both can be interpolated:
    bremsstrahlung per keV, divided by (kVp - E), is smooth in kVp, E and angle;
    a line, divided by (kVp/edge - 1)^1.63, is smooth in kVp and angle.
Writes data/tungsten.bin.deflate and prints its SHA-256.

Layout, little endian, before raw DEFLATE:
    u32 n_kvp, n_angle, n_bin, n_line
    f32 lowest bin edge, bin width, keV
    f32[n_kvp] tube voltages, kV;  f32[n_angle] anode angles, degrees
    f32[n_line] line energies, keV;  f32[n_line] their edges, keV
    f32[n_kvp][n_angle][n_bin] ln of the reduced bremsstrahlung at the bin centres; above kVp the last value repeats
    f32[n_kvp][n_angle][n_line] reduced lines; 0 below the edge
"""

import hashlib
import pathlib
import struct
import zlib

import numpy as np
import spekpy

OUT = pathlib.Path(__file__).resolve().parent.parent / "data" / "tungsten.bin.deflate"
VOLTAGES = np.arange(40.0, 151.0, 5.0)
ANGLES = np.array([1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 12.0, 14.0, 17.0, 20.0, 25.0, 30.0])
LOW, WIDTH, HIGH = 1.0, 0.5, 150.0
SOFTEST_LINE = 5.0
K_EDGE, L3_EDGE = 69.5, 10.2
EXPONENT = 1.63


def line_bins(spek):
    """Bin -> (mean energy of its lines, edge of their shell)."""
    found = {}
    for shell in ("K", "L_1", "L_2", "L_3"):
        data = spek._line_data[shell]
        edge = K_EDGE if shell == "K" else L3_EDGE
        for energy, weight in zip(data["Lines"], data["W"]):
            if weight > 0 and energy > SOFTEST_LINE:
                found.setdefault(int((energy - LOW) / WIDTH), []).append((energy, weight, edge))
    return {
        b: (sum(e * w for e, w, _ in v) / sum(w for _, w, _ in v), max(edge for _, _, edge in v))
        for b, v in sorted(found.items())
    }


def main():
    lines = line_bins(spekpy.Spek(kvp=150, th=12, dk=WIDTH, z=100))
    n_bin = round((HIGH - LOW) / WIDTH)
    centres = LOW + WIDTH * (np.arange(n_bin) + 0.5)
    brem = np.zeros((len(VOLTAGES), len(ANGLES), n_bin))
    chars = np.zeros((len(VOLTAGES), len(ANGLES), len(lines)))
    for i, kvp in enumerate(VOLTAGES):
        for j, angle in enumerate(ANGLES):
            k, per_kev = spekpy.Spek(kvp=kvp, th=angle, dk=WIDTH, z=100, mas=1, char=False).get_spectrum()
            assert np.allclose(k, centres[: len(k)]) and abs(k[-1] + WIDTH / 2 - kvp) < 1e-9
            # In the softest bins nothing leaves the anode; keep the logarithm finite.
            reduced = np.log(np.maximum(per_kev, 1e-30) / (kvp - k))
            brem[i, j, : len(k)] = reduced
            brem[i, j, len(k) :] = reduced[-1]
            k, per_kev = spekpy.Spek(kvp=kvp, th=angle, dk=WIDTH, z=100, mas=1, brem=False).get_spectrum()
            for column, (b, (_, edge)) in enumerate(lines.items()):
                if kvp > edge and b < len(k):
                    chars[i, j, column] = per_kev[b] * WIDTH / (kvp / edge - 1) ** EXPONENT
        print(kvp, flush=True)
    f32 = lambda a: np.asarray(a, dtype="<f4").tobytes()
    blob = struct.pack("<IIIIff", len(VOLTAGES), len(ANGLES), n_bin, len(lines), LOW, WIDTH)
    blob += f32(VOLTAGES) + f32(ANGLES)
    blob += f32([e for e, _ in lines.values()]) + f32([edge for _, edge in lines.values()])
    blob += f32(brem) + f32(chars)
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    packed = packer.compress(blob) + packer.flush()
    OUT.write_bytes(packed)
    print(len(blob), "->", len(packed), "bytes, sha256", hashlib.sha256(packed).hexdigest())


if __name__ == "__main__":
    main()
