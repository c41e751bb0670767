"""From a photoelastic frame to inferred forces, by the command line alone."""

import json

import frames
import numpy as np
import pandas as pd
import pytest

from granforce.cli.entry_point import main
from granforce.experiment.pegs import read_pegs
from granforce.experiment.synthetic import synthetic_frame
from granforce.forces.build import ensemble
from granforce.forces.grain_pressures import grain_pressures
from granforce.packing.compaction import pack
from granforce.packing.importers import load_packing, save_packing

pytestmark = pytest.mark.fast


@pytest.fixture
def folder(away):
    grains, rows, _ = frames.frame(60, missing=0.1, noise=0.1, seed=2)
    frames.write(away, grains, rows)
    return away


def told(words, capsys):
    assert main([*words.split(), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_a_frame_becomes_a_packing_and_its_forces_are_inferred(folder, capsys):
    frame = told(
        "import pegs positions.txt adjacency.txt --mu 0.3 --reach 0.1 --out frame.npz "
        "--measured frame.csv",
        capsys,
    )
    packing = load_packing(folder / "frame.npz")
    assert frame["contacts_listed"] + frame["candidates"] == len(packing.contacts.i)
    infer = "infer frame.npz --measured frame.csv --unmeasured 1 --states 40 --certain"
    found = told(f"{infer} --out inferred.csv", capsys)
    assert not found["cached"] and found["states"] == 40
    assert found["measured_components"] == 2 * frame["contacts_listed"]
    assert found["measured_where_nothing_can_carry"] == 0
    columns = pd.read_csv(folder / "inferred.csv")
    normal, least = columns["f_n [packing]"], columns["f_n_least [packing]"]
    assert len(columns) == found["contacts"]
    assert np.all(normal >= 0) and np.all(columns["f_n_error [packing]"] > 0)
    sure = columns["contact"][least > 1e-6 * normal.mean()].astype(int)
    assert set(found["carry_for_certain"]) == set(sure.tolist())
    assert told(infer, capsys)["cached"]
    other = told(f"{infer} --sample-seed 1", capsys)
    assert not other["cached"] and other["chi_square"] == found["chi_square"]


def test_without_draws_there_are_no_error_bars(folder, capsys):
    (folder / "some.csv").write_text("contact,f_n,f_t,sigma_n,sigma_t\n3,1.5,,0.1,\n4,,0.1,,0.1\n")
    found = told("infer -n 20 --mu 0.3 --measured some.csv --states 0", capsys)
    assert found["measured_components"] == 2 and "mean_standard_error [packing]" not in found
    assert found["chi_square"] >= 0


def test_a_measurement_of_another_packing_is_told(folder, capsys):
    (folder / "some.csv").write_text("contact,f_n,f_t,sigma_n,sigma_t\n5000,1.5,,0.1,\n")
    assert main("infer -n 20 --mu 0.3 --measured some.csv".split()) == 2
    assert "right packing" in capsys.readouterr().err


def test_what_was_mended_is_told_and_may_be_forbidden(folder, capsys):
    with open(folder / "adjacency.txt", "a") as file:
        file.write("\n1,3,99999,0.0,0.01")
    words = "import pegs positions.txt adjacency.txt --mu 0.3 --reach 0.1"
    found = told(words, capsys)
    assert found["contacts_of_missing_grains"] == 1 and "99999" in found["findings"][0]
    assert main(words.split()) == 0
    assert "99999" in capsys.readouterr().out
    for options in ("--strict", "--repair 2", "--walls cube"):
        assert main([*words.split(), *options.split()]) == 2
        assert capsys.readouterr().err.count("\n") == 1
    assert main([*words.split(), "--walls", "box", "--wall-force", "right: 1 2"]) == 2
    walls = told(f"{words} --walls box", capsys)
    assert walls["walls"] == "left, right, bottom, top" and walls["wall_contacts"] > 4


def test_error_bars_by_measuring_again(folder, capsys):
    told(
        "import pegs positions.txt adjacency.txt --mu 0.3 --reach 0.1 --out frame.npz "
        "--measured frame.csv",
        capsys,
    )
    words = "infer frame.npz --measured frame.csv --unmeasured 1 --states 40"
    flat, again = told(words, capsys), told(f"{words} --again", capsys)
    assert again["states"] == 40 and not again["cached"]
    assert again["chi_square"] == flat["chi_square"]
    assert again["mean_standard_error [packing]"] != flat["mean_standard_error [packing]"]
    assert told(f"{words} --again", capsys)["cached"]


def test_g_squared_of_grains_is_calibrated_and_inferred(folder, capsys):
    """The same pressures as a column of pressures, as G², and as columns of a frame."""
    packing = pack(20, 0.3, seed=0)
    save_packing(packing, "p.npz")
    S = ensemble(packing)
    true = grain_pressures(S, S.original)
    rows = {"grain": np.arange(20), "pressure": true, "sigma": 0.1, "G2": (true - 0.5) / 2}
    pd.DataFrame(rows).to_csv("grains.csv", index=False)
    alone = told("infer p.npz --pressures grains.csv --states 0 --out all.csv", capsys)
    assert alone["measured_pressures"] == 20 and alone["suspect_grains"] == []
    words = "infer p.npz --pressures grains.csv --states 0 --pressure-column G2"
    squared = told(f"{words} --calibration 2,0.5,0.1", capsys)
    assert squared["chi_square"] == pytest.approx(alone["chi_square"], abs=1e-6)
    frame = synthetic_frame(packing, noise=0.0)
    frame.write("positions.csv", "links.csv", pressures=True)
    sigma = 0.1 * float(np.mean(frame.only.pressure))
    words = "infer positions.csv links.csv --frames all --mu 0.3 --states 0 --workers 1"
    (one,) = told(f"{words} --pressure-column pressure --calibration 1,0,{sigma}", capsys)
    (two,) = told(words, capsys)
    assert one["freedom"] > two["freedom"]
    photo = read_pegs(frame, mu=0.3, calibration=(1, 0, sigma))
    assert 0 < len(photo.pressures.grains) == photo.report["measured_pressures"]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ("--pressures grains.csv --pressure-column G2", "needs its calibration"),
        ("--pressures grains.csv --calibration 1,0,1", "--calibration has no effect"),
        ("--measured m.csv --pressure-column G2 --calibration 1,0,1", "--pressure-column has no"),
        ("--pressures grains.csv --pressure-column G2 --calibration 1,0", "calibration a,b,sigma"),
        ("--pressures grains.csv --pressure-column x --calibration 1,0,1", "no column x"),
        ("", "give a packing and --measured"),
    ],
)
def test_pressures_that_cannot_be_used_are_refused(folder, capsys, options, words):
    (folder / "grains.csv").write_text("grain,G2\n0,1\n")
    (folder / "m.csv").write_text("contact,f_n,f_t,sigma_n,sigma_t\n3,1.5,,0.1,\n")
    command = f"infer -n 20 --mu 0.3 --states 0 {options}".split()
    if "no effect" in words or "has no" in words:  # refused while the options are read
        with pytest.raises(SystemExit, match="2"):
            main(command)
    else:
        assert main(command) == 2
    error = capsys.readouterr().err
    assert words in error and error.count("\n") == 1
