#!/usr/bin/env python3
"""Tabulate photon cross sections of the elements for ppa-xray.

    python -m venv venv && venv/bin/pip install xraylib==4.3.0 numpy
    venv/bin/python ppa-xray/scripts/make_cross_sections.py

Source: xraylib 4.3.0 (BSD 3-clause), whose photoelectric, Rayleigh and Compton
cross sections, form factors F(q) and scattering functions S(q) come from EPDL97,
whose Compton profiles are those of Biggs, Mendelsohn and Mann (1975), and whose
fluorescence yields, jump factors, line energies and radiative rates are those
listed in its documentation (Schoonjans et al. 2011, doi:10.1016/j.sab.2011.09.011).
Writes data/elements.bin.deflate (layout below) and prints its SHA-256.

Layout, little endian, before raw DEFLATE:
    u32 number of elements (Z = 1, 2, ...), u32 n_energy, u32 n_q
    f32[n_energy] energies of the scattering cross sections, keV
    f32[n_q]      q = sin(theta/2)/lambda, 1/Angstrom
    per element:
        f32 atomic weight, u32 n_photo
        f32[n_photo] photoelectric energies, keV; an edge stands twice
        f32[n_photo] photoelectric, cm2/g
        f32[n_energy] Rayleigh, cm2/g;  f32[n_energy] Compton, cm2/g
        f32[n_q] F(q);  f32[n_q] S(q)
        u32 n_shells, per shell: f32 electrons, f32 binding energy in keV, f32 J(0) in atomic units
        f32 K edge in keV, f32 K fluorescence yield, f32 share of the K shell in photoelectric absorption
        per line K-alpha1, K-alpha2, K-beta1 (from M), K-beta2 (from N and beyond): f32 keV, f32 share
        (all zero for an element without K fluorescence above 1 keV)
All tables are meant for straight lines in log-log, except that F and S are
linear in q below the first positive q.
"""

import hashlib
import pathlib
import struct
import zlib

import numpy as np
import xraylib

OUT = pathlib.Path(__file__).resolve().parent.parent / "data" / "elements.bin.deflate"
E_MIN, E_MAX = 1.0, 150.0
HC_KEV_ANGSTROM = 12.398419843320026
LAST_Z = 92
TOLERANCE = 3e-4  # of the log-log interpolation of the photoelectric part
SMALLEST_EDGE = 2e-3  # relative jump that counts as an edge


def edges(z):
    """Energies at which the photoelectric part jumps, found by bisection."""
    photo = lambda e: xraylib.CS_Photo(z, float(e))
    found = []
    grid = np.exp(np.linspace(np.log(E_MIN), np.log(E_MAX), 6001))
    values = np.log([photo(e) for e in grid])
    for lo, hi, jump in zip(grid[:-1], grid[1:], np.diff(values)):
        if jump < SMALLEST_EDGE:
            continue
        while hi / lo > 1 + 1e-8:
            mid = np.sqrt(lo * hi)
            if np.log(photo(mid) / photo(lo)) > np.log(photo(hi) / photo(mid)):
                hi = mid
            else:
                lo = mid
        if np.log(photo(hi) / photo(lo)) > SMALLEST_EDGE:
            found.append((lo, hi))
    return found


def smooth_piece(z, lo, hi):
    """Nodes between two edges, halved until a straight line in log-log is good enough."""
    photo = lambda e: xraylib.CS_Photo(z, float(e))

    def refine(a, fa, b, fb):
        worst = 0.0
        for t in (0.25, 0.5, 0.75):
            e = a ** (1 - t) * b**t
            worst = max(worst, abs(np.log(photo(e)) - ((1 - t) * np.log(fa) + t * np.log(fb))))
        if worst < TOLERANCE or b / a < 1.0005:
            return []
        mid = np.sqrt(a * b)
        fm = photo(mid)
        return refine(a, fa, mid, fm) + [(mid, fm)] + refine(mid, fm, b, fb)

    flo, fhi = photo(lo), photo(hi)
    return [(lo, flo)] + refine(lo, flo, hi, fhi) + [(hi, fhi)]


def photoelectric(z):
    nodes, start = [], E_MIN
    for below, above in edges(z):
        edge = np.sqrt(below * above)
        piece = smooth_piece(z, start, below)
        nodes += piece[:-1] + [(edge, piece[-1][1])]
        start = above
    nodes += smooth_piece(z, start, E_MAX)
    # The upper side of an edge gets the very energy of its lower side.
    out = []
    for e, f in nodes:
        if out and 0 < e / out[-1][0] - 1 < 3e-8:
            e = out[-1][0]
        out.append((e, f))
    return np.array(out, dtype=np.float64)


SHELLS = [
    f"{letter}{i}" if count > 1 else letter
    for letter, count in zip("KLMNOPQ", (1, 3, 5, 7, 7, 5, 3))
    for i in range(1, count + 1)
]
LINES = [
    ["KL3"],
    ["KL2"],
    [f"KM{i}" for i in range(1, 6)],
    [f"KN{i}" for i in range(1, 8)] + ["KO", "KP"],
]


def known(function, z, name, otherwise):
    """What xraylib knows, or `otherwise` where it has no value."""
    try:
        return function(z, getattr(xraylib, name))
    except (ValueError, AttributeError):
        return otherwise


def subshell_partner(name):
    """The other spin-orbit half of a subshell, which has nearly the same profile: L2 and L3, M4 and M5."""
    if len(name) == 1 or name[1] == "1":
        return name
    return name[0] + str(int(name[1]) ^ 1)


def shells(z):
    """(electrons, binding energy in keV, J(0)) of every occupied shell; no binding energy is 0."""
    found = []
    for name in SHELLS:
        macro = name + "_SHELL"
        electrons = known(xraylib.ElectronConfig, z, macro, 0.0)
        if electrons > 0:
            profiles = [
                known(lambda z, shell: xraylib.ComptonProfile_Partial(z, shell, 0.0), z, half, None)
                for half in (macro, subshell_partner(name) + "_SHELL")
            ]
            profile = next((value for value in profiles if value is not None), None)
            found.append([electrons, known(xraylib.EdgeEnergy, z, macro, 0.0), profile])
    assert abs(sum(electrons for electrons, _, _ in found) - z) < 1e-3, z
    assert all(profile is not None for _, _, profile in found), z
    return found


def k_fluorescence(z):
    edge = known(xraylib.EdgeEnergy, z, "K_SHELL", 0.0)
    emitted = known(xraylib.FluorYield, z, "K_SHELL", 0.0)
    jump = known(xraylib.JumpFactor, z, "K_SHELL", 1.0)
    lines = []
    for group in LINES:
        rates = [known(xraylib.RadRate, z, name + "_LINE", 0.0) for name in group]
        energies = [known(xraylib.LineEnergy, z, name + "_LINE", 0.0) for name in group]
        rate = sum(rates)
        lines.append((np.dot(rates, energies) / rate if rate > 0 else 0.0, rate))
    total = sum(rate for _, rate in lines)
    if edge < E_MIN or emitted == 0 or total == 0:
        return [0.0] * 11
    assert abs(total - 1) < 2e-3, (z, total)
    return [edge, emitted, 1 - 1 / jump] + [v for energy, rate in lines for v in (energy, rate / total)]


def main():
    energy = np.exp(np.linspace(np.log(E_MIN), np.log(E_MAX), 121))
    energy[0], energy[-1] = E_MIN, E_MAX
    q_max = E_MAX / HC_KEV_ANGSTROM
    q = np.concatenate([[0.0], np.exp(np.linspace(np.log(2e-3), np.log(q_max * 1.0001), 139))])
    f32 = lambda a: np.asarray(a, dtype="<f4").tobytes()
    blob = struct.pack("<III", LAST_Z, len(energy), len(q)) + f32(energy) + f32(q)
    for z in range(1, LAST_Z + 1):
        photo = photoelectric(z)
        blob += struct.pack("<fI", xraylib.AtomicWeight(z), len(photo))
        blob += f32(photo[:, 0]) + f32(photo[:, 1])
        blob += f32([xraylib.CS_Rayl(z, float(e)) for e in energy])
        blob += f32([xraylib.CS_Compt(z, float(e)) for e in energy])
        blob += f32([xraylib.FF_Rayl(z, float(x)) for x in q])
        blob += f32([xraylib.SF_Compt(z, float(x)) if x > 0 else 0.0 for x in q])
        occupied = shells(z)
        blob += struct.pack("<I", len(occupied)) + f32(occupied) + f32(k_fluorescence(z))
        print(z, len(photo), "nodes, edges at", np.round([a for a, _ in edges(z)], 4), flush=True)
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    packed = packer.compress(blob) + packer.flush()
    OUT.write_bytes(packed)
    print(len(blob), "->", len(packed), "bytes, sha256", hashlib.sha256(packed).hexdigest())


if __name__ == "__main__":
    main()
