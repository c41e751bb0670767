"""Series of frames: found in folders, inferred over processes, resumed, in one dataset."""

import json
import warnings

import numpy as np
import pytest
import xarray as xr
from frames import write
from full_disk import files_of
from packings import packed

from granforce.cli.entry_point import main
from granforce.experiment.frames import frames_of
from granforce.experiment.synthetic import synthetic_frame
from granforce.records import InputError
from granforce.study import series
from granforce.study.store import open_store


def folder_of(tmp_path, numbers=(1, 2, 3), **options):
    """Frames of one packing, measured anew each time, a pair of files each."""
    for number in numbers:
        frame = synthetic_frame(
            packed(40, 0.3), noise=0.1, number=number, seed=number, walls=False, **options
        )
        frame.write(
            tmp_path / f"Step-{number:04d}_centers.txt",
            tmp_path / f"Step-{number:04d}_Adjacency.txt",
        )
    return tmp_path


OPTIONS = {"mu": 0.3, "states": 16, "reach": 0.1}
BROKEN = "Step-0002_Adjacency.txt"


def test_frames_are_inferred_and_found_again(tmp_path):
    frames = frames_of(folder_of(tmp_path))
    assert [frame.number for frame in frames] == [1, 2, 3]
    dataset, failed = series.infer_series(tmp_path / "store", frames, workers=1, **OPTIONS)
    assert not failed and dataset.sizes["frame"] == 3
    assert np.isfinite(dataset["inferred"]).any("contact").all()
    assert np.isnan(dataset["change"][0]).all() and np.isfinite(dataset["change"][1]).any()
    listed = np.isfinite(dataset["measured"]).all("component")
    assert np.all((dataset["standard_error"] > 0).where(listed, True))
    # The same packing: what changes is error, and the errors say so.
    z = (dataset["change"] / dataset["change_error"]).values[1:][listed.values[1:]]
    assert np.mean(np.abs(z[np.isfinite(z)]) < 2) > 0.8
    seen = []
    again, _ = series.infer_series(
        tmp_path / "store", frames, workers=1, progress=lambda *p: seen.append(p), **OPTIONS
    )
    assert xr.testing.assert_identical(dataset, again) is None and not seen


@pytest.fixture(scope="module")
def refused(tmp_path_factory):
    """A folder of three frames, the second of which is refused; what two processes made of it."""
    folder = folder_of(tmp_path_factory.mktemp("frames"))
    (folder / BROKEN).write_text("2,900,901,0,1\n2,903,904,0,1\n")
    frames = frames_of(folder)
    return folder, *series.infer_series(folder / "store", frames, workers=2, **OPTIONS)


def test_a_frame_that_is_refused_costs_only_itself(refused):
    folder, dataset, ((frame, message),) = refused
    assert dataset["frame"].values.tolist() == [1, 3]
    assert frame.number == 2 and "join neighbours" in message
    # Mended, it is read anew; the others are found.
    broken = (folder / BROKEN).read_text()
    try:
        folder_of(folder, (2,))
        seen = []
        _, failed = series.infer_series(
            *(folder / "store", frames_of(folder)),
            workers=1,
            progress=lambda *p: seen.append(p),
            **OPTIONS,
        )
        assert not failed and seen[-1] == (1, 1)
    finally:
        (folder / BROKEN).write_text(broken)


def test_all_frames_of_one_pair_of_files(tmp_path):
    one, two = (
        synthetic_frame(packed(40, 0.3), noise=0.1, number=n, seed=n, walls=False) for n in (4, 9)
    )
    for k, frame in enumerate((one, two)):
        frame.write(tmp_path / f"p{k}", tmp_path / f"a{k}")
    for name in ("p", "a"):
        text = (tmp_path / f"{name}0").read_text() + (tmp_path / f"{name}1").read_text()
        (tmp_path / f"{name}.txt").write_text(text)
    frames = frames_of(tmp_path / "p.txt", tmp_path / "a.txt")
    assert [frame.number for frame in frames] == [4, 9]


def test_folders_without_frames_are_told(tmp_path):
    with pytest.raises(InputError, match="no frames"):
        frames_of(tmp_path)
    (tmp_path / "notes.txt").write_text("nothing")
    with pytest.raises(InputError, match="no frames"):
        frames_of(tmp_path)


def test_by_the_command_line(away, capsys):
    (away / "lab").mkdir()
    folder_of(away / "lab", (1, 2))

    def words(frames="all", out="series.zarr"):
        words = f"infer lab --frames {frames} --mu 0.3 --reach 0.1 --states 16 --out {out}"
        return [*words.split(), "--workers", "1"]

    assert main([*words(), "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert [row["frame"] for row in rows] == [1, 2] and rows[0]["grains"] == 40
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        written = xr.open_zarr(away / "series.zarr")
    assert written.sizes["frame"] == 2 and "inferred" in written
    assert main(words("2")) == 0
    assert xr.open_zarr(away / "series.zarr").sizes["frame"] == 1
    capsys.readouterr()
    for wrong in (words("7"), words("x"), words(out="lab")):
        assert main(wrong) == 2, wrong
        assert capsys.readouterr().err.count("\n") == 1
    assert main(["infer", "--mu", "0.3"]) == 2
    assert len(list(open_store(away / "cache").find("frame"))) == 2


def test_without_states_there_are_no_error_bars(away, capsys):
    """The same forces as with them."""
    (away / "lab").mkdir()
    folder_of(away / "lab", (1, 2))
    words = (
        "infer lab --frames all --mu 0.3 --reach 0.1 --workers 1 --out series.zarr --json --states"
    )
    forces = {}
    for states in (0, 4):
        assert main([*words.split(), str(states)]) == 0
        assert all(
            ("changed" in row) == (states > 0) for row in json.loads(capsys.readouterr().out)
        )
        written = xr.open_zarr(away / "series.zarr", consolidated=False)
        assert ("standard_error" in written) == ("change_error" in written) == (states > 0)
        forces[states] = written["inferred"].values
    assert np.array_equal(forces[0], forces[4], equal_nan=True)
    assert main([*words.split(), "1"]) == 2


def test_names_of_files_of_positions_and_adjacency(tmp_path):
    import frames as made

    grains, rows, _ = made.frame(20)
    write(tmp_path, grains, rows)
    (frame,) = frames_of(tmp_path)
    assert frame.positions.endswith("positions.txt") and frame.number == 1


def test_a_series_that_cannot_be_written_leaves_nothing(tmp_path):
    rng = np.random.default_rng(0)
    whole = xr.Dataset({"f": (("frame", "contact"), rng.random((50, 200)))})
    path = tmp_path / "series.zarr"
    with files_of(4000), pytest.raises(InputError, match="File too large"):
        series.save_series(whole, path)
    assert not list(tmp_path.iterdir())
    series.save_series(whole, path)
    xr.testing.assert_equal(xr.open_zarr(path).load(), whole)
