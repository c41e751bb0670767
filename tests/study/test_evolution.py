"""Series of the snapshots of a simulation."""

import json

import numpy as np
import pytest
import xarray as xr
from packing.test_simulations import MU, contacts, given, mercury_in_a_box, particles

from granforce.cli.entry_point import main
from granforce.explore.intervals import intervals
from granforce.forces.build import ensemble
from granforce.packing.importers import open_lammps
from granforce.records import InputError
from granforce.study.evolution import evolution


def without_a_row(step):
    """The forces of a snapshot in which the lowest row of disks carries nothing along itself."""
    text = contacts(step, 2.0)
    for first, second in ((1, 2), (2, 3), (3, 1)):
        text = text.replace(f"\n{first} {second} 1 -2.0 0.0 0 0", f"\n{first} {second} 1 0 0 0 0")
        text = text.replace(f"\n{first} {second} 1 -2.0 -0.0 0 0", f"\n{first} {second} 1 0 0 0 0")
    return text


STEPS = 100, 200, 300
DUMPS = (
    "".join(map(particles, STEPS[:2])) + particles(300, scale=0.5),  # disks lie on each other
    contacts(100, 1.0) + without_a_row(200) + contacts(300, 3.0),
)


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    path = tmp_path_factory.mktemp("store") / "cache"
    opened = open_lammps(*given(*DUMPS), MU)
    return path, opened, *evolution(path, opened, states=4, workers=1)


def test_every_snapshot_has_its_intervals(found):
    _, opened, dataset, failed = found
    assert dataset["frame"].values.tolist() == [100, 200]
    assert dataset["contacts"].values.tolist() == [18, 15]
    for k, step in enumerate(STEPS[:2]):
        packing = opened.snapshot(step).packing
        S = ensemble(packing)
        bounds = intervals(S)
        one = dataset.isel(frame=k)
        ends = np.column_stack([packing.contacts.i, packing.contacts.j])[bounds.contacts] + 1
        place = [
            np.flatnonzero((one["id1"] == min(pair)) & (one["id2"] == max(pair)))[0]
            for pair in ends.tolist()
        ]
        np.testing.assert_allclose(one["low"].values[place], bounds.low, atol=1e-8)
        np.testing.assert_allclose(one["high"].values[place], bounds.high, atol=1e-8)
        assert int(one["dimension"]) == S.dimension
        assert float(one["pressure"]) == packing.pressure and float(one["residual"]) < 1e-9
    assert np.all(dataset["eta1"] > 0) and np.all(dataset["eta3"] > dataset["eta1"])
    # Contacts that a snapshot does not have.
    gone = np.isnan(dataset["forces"].values[1]).all(axis=1)
    assert gone.sum() == 3 and not np.isnan(dataset["forces"].values[0]).any()
    ((number, message),) = failed
    assert number == 300 and "overlap" in message


def test_snapshots_are_found_again_for_any_number_of_workers(found):
    path, opened, dataset, failed = found
    again, refused = evolution(path, opened, states=4, workers=2)
    assert refused == failed
    xr.testing.assert_identical(again, dataset)


def test_by_the_command_line(away, capsys):
    for name, text in zip(("p", "c"), DUMPS, strict=True):
        (away / name).write_text(text)
    words = ["import", "lammps", "p", "c", "--mu", "0.3", "--workers", "1"]
    assert main([*words, "--frames", "all", "--out", "s.zarr", "--csv", "s.csv", "--json"]) == 1
    out, err = capsys.readouterr()
    rows = json.loads(out, parse_constant=lambda word: pytest.fail(f"{word} is no JSON"))
    assert [row["frame"] for row in rows] == [100, 200] and rows[0]["eta1"] is None
    assert "timestep 300: " in err and "overlap" in err
    table = np.genfromtxt("s.csv", delimiter=",", names=True)
    assert table["eta3"].tolist() == [row["eta3"] for row in rows]
    with xr.open_zarr("s.zarr", consolidated=False) as dataset:
        assert dataset["dimension"].values.tolist() == [row["dimension"] for row in rows]
    assert main([*words, "--frames", "200"]) == 0
    for frames, said in (("7", "no timestep 7: there is 100 … 300"), ("x", "all, or numbers")):
        assert main([*words, "--frames", frames]) == 2
        assert said in capsys.readouterr().err


def test_notes_are_kept_and_told(away, capsys):
    for name, text in zip(("m.data", "m.fstat"), mercury_in_a_box(1), strict=True):
        (away / name).write_text(text)
    words = "import mercury m.data m.fstat --mu 0.5 --walls pressing --frames 0 --out s.zarr"
    assert main([*words.split(), "--workers", "1"]) == 0
    err = capsys.readouterr().err
    assert "time step 0: 8 contacts with walls (-1, -2, -3, -4) are contacts" in err
    with xr.open_zarr("s.zarr", consolidated=False) as dataset:
        assert "8 contacts with walls" in json.loads(dataset.attrs["notes"])["0"][0]
        assert dataset["dimension"].values.tolist() == [6] and dataset["id2"].values.min() == -4


def test_numbers_that_are_not_there_are_refused():
    with pytest.raises(InputError, match="no timestep 5: there is 100 … 300"):
        open_lammps(*given(*DUMPS), MU).snapshot(5)
