"""Metrics, tests, spectra and materials give the same numbers as the command line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ppa

from conftest import command


def test_metrics_are_those_of_the_command_line(tmp_path: Path) -> None:
    labels, predictions = [1.0, 1.5, 2.5, 3.0, 2.0], [1.2, 1.4, 2.1, 2.9, 2.5]
    rows = [f"{i},{a},{b}" for i, (a, b) in enumerate(zip(labels, predictions))]
    table = tmp_path / "table.csv"
    table.write_text("id,label,prediction\n" + "\n".join(rows))
    printed = json.loads(command("metrics", table, "--json"))
    computed = ppa.evaluate(labels, np.array(predictions))
    assert {key: computed[key] for key in printed} == printed


def test_permutations_are_those_of_the_command_line(tmp_path: Path) -> None:
    a, b, seeds = [0.3, 0.5, 0.2, 0.9], [0.1, 0.6, 0.1, 0.2], [1, 1, 2, 2]
    table = tmp_path / "table.csv"
    table.write_text("seed,a,b\n" + "\n".join(f"{s},{x},{y}" for s, x, y in zip(seeds, a, b)))
    printed = json.loads(command("stats", "permutation", table, "--json"))
    assert ppa.permutation_test(a, b, seeds=seeds) == printed


def test_spectra_are_those_of_the_command_line() -> None:
    printed = json.loads(command("xray", "spectrum", "--kvp", 70, "--filter", "Al:3", "--json"))
    spectrum = ppa.Spectrum(70, ["Al:3"])
    assert {key: getattr(spectrum, key) for key in printed} == printed
    assert spectrum.weights.sum() == pytest.approx(1)
    assert len(spectrum.edges_kev) == len(spectrum.weights) + 1


def test_cross_sections_are_those_of_the_command_line() -> None:
    printed = json.loads(command("xray", "materials", "--material", "water", "--energy-kev", 60, "--json"))
    water = ppa.Material("water")
    energies = np.array([[30.0, 60.0], [90.0, 120.0]])
    for part in ["photoelectric", "rayleigh", "compton", "total"]:
        values = getattr(water, f"{part}_cm2_g")(energies)
        assert values.shape == energies.shape
        assert values[0, 1] == printed[f"{part}_cm2_g"]
    assert water.total_cm2_g(60.0).shape == ()
    assert "water" in ppa.Material.names()
    apatite = ppa.Material.compound("apatite", 3.16, "Ca:0.3989,P:0.1850,O:0.4141,H:0.0020")
    assert apatite.photoelectric_cm2_g(30.0) > water.photoelectric_cm2_g(30.0)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: ppa.evaluate([1, 2], [1]), "2"),
        (lambda: ppa.evaluate([1, np.nan], [1, 2]), "NaN"),
        (lambda: ppa.evaluate([], []), ""),
        (lambda: ppa.evaluate([[1.0]], [1.0]), "labels has the shape (1, 1), expected (n,)"),
        (lambda: ppa.permutation_test([1, 2], [1, 2], seeds=[0.5, 1]), "seeds contains 0.5"),
        (lambda: ppa.permutation_test([1, 2], [1, 2], threads=0), "threads is 0"),
        (lambda: ppa.Spectrum(1000), "1000"),
        (lambda: ppa.Spectrum(60, ["Xx:1"]), "Xx"),
        (lambda: ppa.Material("unobtainium"), "unobtainium"),
        (lambda: ppa.Material("water").total_cm2_g([60.0, -1.0]), "-1"),
        (lambda: ppa.phantom("P99"), "P99"),
        (lambda: ppa.phantom(side="x"), 'side is "x"'),
        (lambda: ppa.phantom(spacing_mm=float("nan")), "NaN"),
    ],
)
def test_what_makes_no_sense_is_refused(call: Any, says: str) -> None:
    with pytest.raises(ValueError) as refused:
        call()
    assert says in str(refused.value)


# Short lists: the exact test evaluates all 2^n sign patterns.
anything = st.one_of(
    st.none(), st.text(), st.floats(), st.lists(st.one_of(st.floats(), st.none(), st.text()), max_size=12))


@given(a=anything, b=anything, seeds=anything)
@settings(max_examples=200, deadline=None)
def test_any_argument_gives_an_answer_or_an_exception(a: Any, b: Any, seeds: Any) -> None:
    for call in [
        lambda: ppa.evaluate(a, b),
        lambda: ppa.permutation_test(a, b, seeds=seeds),
        lambda: ppa.Spectrum.from_bins(a, b),
        lambda: ppa.Material("water").total_cm2_g(a),
    ]:
        try:
            call()
        except (ValueError, TypeError):
            pass
