"""Memory: nothing that computes keeps more of it from call to call.

What C and C++ take is unseen by tracemalloc: the resident set of the process (RSS) is measured, as
Linux tells it, after the allocator has given back what is free.
"""

import ctypes
import gc
import io
import sys
from pathlib import Path

import numpy as np
import pytest
from experiment.test_solved import mat
from frames import file, frame, solved
from packing.test_importers import SMALL, cluster, tables
from packing.test_mutants import small_dumps
from packings import packed
from simulators import MU, N, mercury, yade

import granforce as gf

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")

# What one call may add to the memory on average, MB: leaks that were met took 0.4 to 1.9, and what
# allocators and caches keep of calls without a leak goes to 0 the more calls are made.
MOST = 0.02

BODIES = "body,x,y,r,fixed\n0,0,0,1,1\n1,0,2,1,0\n"  # a disk on a disk


@pytest.fixture(scope="module")
def box():
    return gf.ensemble(packed(20, 0.3))


def memory():
    """MB of the process that are resident."""
    gc.collect()
    try:
        ctypes.CDLL(None).malloc_trim(0)
    except AttributeError:
        pass  # another allocator than glibc's, which keeps what it likes
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096 / 1e6


def growth(call, count, before):
    """MB that each of `count` calls adds, once `before` calls have filled what is kept."""
    for _ in range(before):
        call()
    start = memory()
    for _ in range(count):
        call()
    return (memory() - start) / count


def partly(S, every):
    """Measured forces, one contact in `every` without, and their error."""
    measured = S.original.copy()
    measured[::every] = np.nan
    return measured, 0.1 * S.force_scale


def frozen(S):
    """Bounds within frozen surroundings: S is so thin that HiGHS goes from vertex to vertex."""
    packing = S.packing
    thin = gf.ensemble(packing, frozen=packing.x[packing.contacts.i, 0] > 0.6 * packing.box[0])
    return gf.intervals(thin, thin.index[:3])


def saved(S):
    archive = io.BytesIO()
    gf.save_packing(S.packing, archive)
    return archive.getvalue()


def fallen():
    packing = gf.scene("leaning", 0.3)
    return gf.fall(packing._replace(load=packing.load[:, [1, 0, 2]]))


def read(reader, contents, **options):
    return reader(*map(io.BytesIO, contents), **options)


def frames():
    grains, rows, _ = frame(16, noise=0.1)
    return [file(part).getvalue().encode() for part in (grains, rows)]


def read_series(S, folder):
    gf.synthetic_frame(S.packing).write(folder / "positions.txt", folder / "adjacency.txt")
    return gf.infer_series(folder / "s.zarr", gf.frames_of(folder), mu=0.3, states=4, workers=1)


def evolved(S, folder):
    snapshots = read(gf.open_lammps, small_dumps(), mu=0.3)
    return gf.evolution(folder / "e.zarr", snapshots, workers=1)


def measured(S):
    m, states = gf.measures, S.original * np.linspace(0.9, 1.1, 5)[:, None, None]
    low, high = m.sampled_intervals(states)
    return m.eta1(states), m.eta2(states), m.eta3(low, high), m.distances(states, S.original)


MEASUREMENT = b"contact,f_n,f_t,sigma_n,sigma_t\n0,1.5,,0.1,\n"
PRESSURES = b"grain,pressure,sigma\n0,1.5,0.1\n"
BOUNDS = b"contact,f_n_low,f_n_high\n0,0,2\n"
_part = {"states": 8, "chains": 2}


# Every public function that computes, or reads: of an Ensemble of 20 disks and a folder.
def looked_up(S, folder):
    with gf.cached(folder / "store.zarr"):
        return gf.intervals(S, contacts=[0])


CALLS = {
    "ensemble": lambda S, _: gf.ensemble(S.packing).dimension,
    "frozen": lambda S, _: frozen(S),
    "infer": lambda S, _: gf.infer(S, *partly(S, 4)),
    "infer, drawn": lambda S, _: gf.infer(S, *partly(S, 4), **_part),
    "remeasured": lambda S, _: gf.remeasured(S, *partly(S, 4), **_part),
    "carrying": lambda S, _: gf.carrying(S, *partly(S, 4)),
    "grain_pressures": lambda S, _: gf.grain_pressures(S, S.original),
    "informative_grains": lambda S, _: gf.informative_grains(
        S, gf.sample_uniform(S, 8).flat, 0.1, 2
    ),
    "read_pressures": lambda S, _: read(gf.read_pressures, [PRESSURES]),
    "informative": lambda S, _: gf.informative(S, 2, check=1, states=40),
    "pack": lambda S, _: gf.pack(6, 0.5, 1),
    "margin": lambda S, _: gf.margin(S.packing),
    "scene": lambda S, _: gf.scene("six", 0.3),
    "gauss_seidel": lambda S, _: gf.gauss_seidel(S, S.original),
    "nearest": lambda S, _: gf.nearest(S, 1.1 * S.original),
    "nearest_of_many": lambda S, _: gf.nearest_of_many(S, [1.1 * S.original] * 2),
    "nearest_piqp": lambda S, _: gf.nearest_piqp(S, 1.1 * S.original),
    "walk": lambda S, _: gf.walk(S, 3, 0),
    "sample_uniform": lambda S, _: gf.sample_uniform(S, **_part),
    "intervals": lambda S, _: gf.intervals(S),
    "limit_loads": lambda S, _: gf.limit_loads(S, S.index[:2]),
    "limit_load_bounds": lambda S, _: gf.limit_load_bounds(S, S.index[:2]),
    "outline": lambda S, _: gf.outline(S, np.eye(2 * len(S.index))[:2].reshape(2, -1, 2)),
    "body": lambda S, _: gf.body(gf.ensemble(gf.scene("pyramid", 0.4))),
    "fall": lambda S, _: fallen(),
    "volume": lambda S, _: gf.volume(gf.ensemble(gf.scene("six", 0.3)), accuracy=0.5),
    "pull": lambda S, _: gf.pull(S, S.index[0], [S.original[0, 0]]),
    "reach": lambda S, _: gf.reach(S, S.index[0]),
    "stress_outline": lambda S, _: gf.stress_outline(S, 8),
    "admissible_stress": lambda S, _: gf.admissible_stress(S),
    "stress_plane": lambda S, _: gf.stress_plane(S, S.original),
    "critical_force": lambda S, _: gf.critical_force(S, S.index[0]),
    "critical_forces": lambda S, _: gf.critical_forces(S, S.index[:2]),
    "response": lambda S, _: gf.response(S, S.index[0]),
    "blocks": lambda S, _: gf.blocks([[[0, 0], [4, 0], [4, 1], [0, 1]], (2, 2, 1)], 0.5, fixed=[0]),
    "load_factor": lambda S, _: gf.load_factor(gf.ensemble(gf.scene("books"))),
    "critical_load": lambda S, _: gf.critical_load(gf.ensemble(gf.scene("books"))),
    "loaded_networks": lambda S, _: gf.loaded_networks(S, S.index[0], [0.0, 0.01]),
    "load_packing": lambda S, _: read(gf.load_packing, [saved(S)]),
    "save_packing": lambda S, _: saved(S),
    "read_known": lambda S, _: read(gf.read_known, [BOUNDS]),
    "read_measurement": lambda S, _: read(gf.read_measurement, [MEASUREMENT]),
    "read_lammps": lambda S, _: read(gf.read_lammps, small_dumps(), mu=0.3),
    "read_mercury": lambda S, _: read(gf.read_mercury, mercury(), mu=MU, box=packed(N, MU).box),
    "read_yade": lambda S, _: read(gf.read_yade, yade(), mu=MU, box=packed(N, MU).box),
    "read_blocks": lambda S, _: gf.read_blocks(io.StringIO(BODIES), mu=0.5),
    "read_table": lambda S, _: gf.read_table(*tables(cluster(gf.load_packing(SMALL), 2.6)), mu=0.3),
    "read_pegs": lambda S, _: read(gf.read_pegs, frames(), mu=0.3),
    "read_pegs, solved": lambda S, _: gf.read_pegs(mat(solved(16)[0]), mu=0.3),
    "synthetic_frame": lambda S, _: gf.synthetic_frame(S.packing),
    "report": lambda S, _: gf.report(S.packing),
    "frames_of": read_series,
    "infer_series": read_series,
    "open_lammps": lambda S, _: read(gf.open_lammps, small_dumps(), mu=0.3),
    "open_mercury": lambda S, _: read(gf.open_mercury, mercury(), mu=MU, box=packed(N, MU).box),
    "save_lammps": lambda S, folder: gf.save_lammps(S.packing, folder / "p", folder / "c"),
    "save_vtk": lambda S, folder: gf.save_vtk(S.packing, folder / "p.vtp", folder / "c.vtp"),
    "evolution": evolved,
    "scan": lambda S, folder: gf.scan(folder / "scan.zarr", [0.3], 1, 8, 2, workers=1),
    "rest": lambda S, _: gf.rest(S, draws=1),
    "open_store": lambda S, folder: gf.open_store(folder / "store.zarr").make(),
    "measures": lambda S, _: measured(S),
    "to_dataset": lambda S, _: gf.to_dataset(S.original, S),
    "to_dataframe": lambda S, _: gf.to_dataframe(S.original, S),
    "to_arviz": lambda S, _: gf.to_arviz(S.original[None, None], S),
    "cached": lambda S, folder: looked_up(S, folder),
    "plot": lambda S, _: gf.plot(S.packing, backend="matplotlib"),
    "from_disks": lambda S, _: gf.from_disks([[1, 1]], [1], 0.5, walls="floor", gravity=1),
}
# They check and name what they are given, and keep nothing.
_RECORDS = {"make_contacts", "make_contacts_at", "make_packing"}


def test_every_public_function_is_called():
    public = {name for name in gf.__all__ if name[0].islower()} - {"figures", "show"} - _RECORDS
    assert public <= set(CALLS)


@pytest.mark.parametrize("name", ["infer", "remeasured", "carrying", "frozen"])
def test_little_memory_is_kept(name, box, tmp_path):
    """Of the calls that lost some; each then kept 12 MB and more."""
    assert growth(lambda: CALLS[name](box, tmp_path), 30, 5) * 30 < 4


@pytest.mark.stress
@pytest.mark.parametrize("name", CALLS)
def test_no_memory_is_kept(name, box, tmp_path):
    assert growth(lambda: CALLS[name](box, tmp_path), 200, 20) < MOST
