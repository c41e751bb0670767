"""What a newcomer tries first, with nothing but the README, `help()` and the TAB key."""

import inspect
import io
import json
import os
import pydoc
import re
import subprocess
import sys
import warnings
from contextlib import suppress
from pathlib import Path

import holoviews as hv
import numpy as np
import pandas as pd
import pytest
import xarray as xr
from packings import packed, reference

import granforce as gf
from granforce import tolerances
from granforce.cli import report_lines
from granforce.cli.command_table import COMMANDS as COMMAND_TABLE
from granforce.cli.command_table import FORMATS
from granforce.cli.entry_point import main
from granforce.cli.parser import make_parser
from granforce.cli.results import with_units
from granforce.explore import uniform
from granforce.explore.random_walk import RELAXATIONS
from granforce.figures import picture
from granforce.glossary import TERMS
from granforce.packing import compaction
from granforce.packing.scenes import SCENES
from granforce.perturb import grain_loads
from granforce.study.cells import scan_rows
from granforce.study.schema import VARIABLES
from granforce.system import terminal
from granforce.system.wording import spaced


def test_tab_and_help_list_the_public_names_and_nothing_else():
    names = [name for name in dir(gf) if not name.startswith("_")]
    assert names == sorted(gf.__all__)
    assert all(getattr(gf, name) is not None for name in names)
    told = pydoc.render_doc(gf, renderer=pydoc.plaintext)
    assert "    pack(" in told and "class Packing(" in told and "find_a_place" not in told


def test_help_shows_the_values_of_constants():
    numbers = (int, float)
    for name in gf.__all__:
        thing = getattr(gf, name)
        home = sys.modules.get(getattr(thing, "__module__", ""), gf)
        for word in re.findall(r"\b[A-Z][A-Z_]{4,}\b", inspect.getdoc(thing) or ""):
            value = getattr(tolerances, word, getattr(home, word, None))
            assert not isinstance(value, numbers) or name == "Side", (name, word)
    told = pydoc.render_doc(gf.pack, renderer=pydoc.plaintext)
    assert f"farther than {compaction.STRIDE:g}." in told
    assert f"by default {compaction.NEARLY_BALANCED:g}, less from {compaction.LATER_FROM} d" in told
    assert "10⁻⁴" in told and compaction.NEARLY_FRICTIONLESS == 1e-4
    told = inspect.getdoc(gf.sample_uniform)
    assert f"up to {uniform.MOST_STATES} times" in told


def test_help_shows_types_by_their_names():
    spaces = [gf, gf.measures, gf.figures]
    functions = {
        function
        for space in spaces
        for name in dir(space)
        if inspect.isfunction(function := getattr(space, name)) and not name.startswith("_")
    }
    assert len(functions) > 60
    for function in functions:
        shown = str(inspect.signature(function))
        assert not re.search(r"numpy\.|collections\.|ForwardRef", shown), function.__name__


def test_the_version_is_said_by_library_and_command(capsys):
    with pytest.raises(SystemExit, match="0"):
        main(["--version"])
    assert capsys.readouterr().out == f"granforce {gf.__version__}\n"
    run = [sys.executable, "-m", "granforce", "--version"]
    assert subprocess.run(run, capture_output=True, text=True).stdout.split()[1] == gf.__version__


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish", "tcsh"])
def test_every_shell_gets_a_script_that_completes(shell, capsys):
    assert main(["completion", shell]) == 0
    script = capsys.readouterr().out
    assert "limit-loads" in script and "ensemble-mu" in script


def test_bash_completes_options_choices_and_files(capsys, tmp_path):
    assert main(["completion", "bash"]) == 0
    (tmp_path / "granforce.bash").write_text(capsys.readouterr().out)
    (tmp_path / "packing.npz").touch()

    def completed(*words):
        line = " ".join(f"'{word}'" for word in words)
        ask = f"""
            source granforce.bash
            COMP_WORDS=({line}) COMP_CWORD={len(words) - 1} COMP_LINE="{" ".join(words)}"
            COMP_POINT=${{#COMP_LINE}}
            $(complete -p granforce | sed 's/.*-F \\([^ ]*\\) .*/\\1/')
            printf '%s\\n' "${{COMPREPLY[@]}}"
        """
        run = subprocess.run(["bash", "-c", ask], cwd=tmp_path, capture_output=True, text=True)
        return run.stdout.split()

    assert "intervals" in completed("granforce", "int")
    assert "--ensemble-mu" in completed("granforce", "intervals", "--ens")
    assert completed("granforce", "walk", "--relax", "gauss_seidel_o") == ["gauss_seidel_only"]
    assert "packing.npz" in completed("granforce", "intervals", "pack")


def of_ensembles():
    """Public functions that take an Ensemble first."""
    functions = {name: getattr(gf, name) for name in gf.__all__}
    first = {
        name: next(iter(inspect.signature(function).parameters.values())).annotation
        for name, function in functions.items()
        if inspect.isfunction(function)
    }
    return [name for name, kind in first.items() if kind in (gf.Ensemble, "Ensemble")]


@pytest.mark.parametrize("name", of_ensembles())
def test_a_packing_where_an_ensemble_is_meant_is_answered_with_the_call_that_makes_one(name):
    function = getattr(gf, name)
    needed = [
        parameter.name
        for parameter in inspect.signature(function).parameters.values()
        if parameter.default is parameter.empty and parameter.kind is not parameter.VAR_KEYWORD
    ]
    with pytest.raises(gf.InputError, match=r"gf\.ensemble\(packing\)"):
        function(gf.scene("groove", 0.5), *(None for _ in needed[1:]))


def test_other_wrong_first_arguments_name_the_call_too():
    assert len(of_ensembles()) > 18
    with pytest.raises(gf.InputError, match=r"'p\.npz'.*gf\.load_packing"):
        gf.ensemble("p.npz")
    S = gf.ensemble(gf.scene("groove", 0.5))
    with pytest.raises(gf.InputError, match=r"give its `\.states`"):
        gf.measures.eta1(gf.walk(S, 5))
    with pytest.raises(gf.InputError, match=r"eta3\(exact\.low, exact\.high\)"):
        gf.measures.eta3(gf.intervals(S))
    with pytest.raises(gf.InputError, match=r"give its `\.flat`"):
        gf.measures.eta2(gf.sample_uniform(S, 8))
    with pytest.raises(gf.NotJammedError, match=r"`granforce stress`.*gf\.stress_outline"):
        gf.ensemble(packed(30, 0.3), prescribed="stress", stress=(5, 0.1, 2))


def test_seeds_have_defaults_as_on_the_command_line():
    defaults = {
        name: parameters["seed"].default
        for name in gf.__all__
        if inspect.isfunction(function := getattr(gf, name))
        and "seed" in (parameters := inspect.signature(function).parameters)
    }
    assert defaults.pop("pack") == 1
    assert defaults.pop("show") is None  # of the walk that it is given, and refused without one
    assert set(defaults.values()) == {0}


def test_a_mistyped_store_leaves_nothing(tmp_path):
    store = gf.open_store(tmp_path / "typo.zarr")
    assert "not there yet" in repr(store)
    readers = (len, list, gf.figures.indeterminacy, lambda s: "walk-1" in s, lambda s: s["walk-1"])
    for read in (*readers, gf.Store.entries, gf.Store.find, gf.Store.verify):
        with pytest.raises(gf.InputError, match=r"^there is no store at .*typo\.zarr; check the p"):
            read(store)
    assert list(tmp_path.iterdir()) == []


def test_a_missing_file_is_said_before_anything_is_imported():
    code = (
        "import sys; from granforce.cli import main\n"
        "code = main(['intervals', 'missing.npz'])\n"
        "print(code, 'numpy' in sys.modules)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert run.stdout == "2 False\n"
    assert run.stderr.count("\n") == 1 and "missing.npz: cannot be read" in run.stderr


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """A folder of one's own, and a store in it."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("GRANFORCE_CACHE", str(tmp_path / "cache"))
    return tmp_path


def report(capsys, *words):
    assert main([str(word) for word in (*words, "--json")]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.parametrize("unit", ["packing", "mean"])
def test_report_table_and_library_agree_in_the_unit_that_names_carry(unit, cache, capsys):
    gf.save_packing(packed(30, 0.3), "p.npz")
    S = gf.ensemble(packed(30, 0.3))
    scale = {"packing": 1, "mean": S.force_scale}[unit]
    words = ["p.npz", "--unit", unit, "--out", "table.csv"]
    told, exact = report(capsys, "intervals", *words), gf.intervals(S)
    table = pd.read_csv("table.csv")
    assert table[f"f_t_high [{unit}]"].to_numpy() == pytest.approx(
        exact.high[:, 1] / scale, abs=1e-7
    )
    extent = (exact.high - exact.low)[:, 0].mean() / scale
    assert told[f"mean_extent_of_f_n [{unit}]"] == pytest.approx(extent, abs=1e-7)
    assert told[f"mean_normal_force [{unit}]"] == pytest.approx(S.force_scale / scale)
    told, loads = report(capsys, "limit-loads", *words), gf.limit_loads(S) / scale
    load = pd.read_csv("table.csv")[f"limit_load [{unit}]"].to_numpy()
    assert load == pytest.approx(loads, abs=1e-7)
    assert told[f"mean_limit_load [{unit}]"] == pytest.approx(loads.mean(), abs=1e-7)


def test_a_table_of_contacts_says_which_grains_touch_and_where(cache, capsys):
    packing = packed(30, 0.3)
    gf.save_packing(packing, "p.npz")
    labels = gf.to_dataframe(gf.intervals(S := gf.ensemble(packing)), S)[["i", "j", "x", "y"]]
    commands = "intervals --out", "limit-loads --out", "measure --states 4 --out"
    for command in (*commands, "perturb --random 2 --out", "informative --best 3 --out"):
        words = [*command.split(), "table.csv", "p.npz"]
        assert main(words) == 0, command
        table = pd.read_csv("table.csv").set_index("contact")
        expected = labels.set_axis(S.index).loc[table.index]
        assert table.columns[:4].tolist() == ["i", "j", "x", "y"]
        assert np.array_equal(table[["i", "j", "x", "y"]], expected)
    assert main("intervals p.npz --out bounds.csv".split()) == 0
    assert gf.read_known("bounds.csv").contacts.tolist() == S.index.tolist()
    assert main("intervals p.npz --out bounds.zarr".split()) == 0
    dataset, known = xr.open_zarr("bounds.zarr"), gf.to_dataset(gf.intervals(S), S)
    assert set(dataset.coords) == set(known.coords) and dataset.attrs == known.attrs
    assert set(dataset) == set(known) and dataset["gap"].attrs == known["gap"].attrs


COMMANDS = {  # with lines that appear in this form only, and are explained all the same
    "pack -n 12 --mu 0.3": {"scene"},
    "walk P --states 4": set(),
    "measure P --states 4": set(),
    "uniform P --states 8": {"reached"},
    "volume P --accuracy 0.5": set(),
    "intervals P --contacts 0,1": {
        *("contacts_with_unbounded_f_n", "contacts_with_unbounded_f_t", "contacts_not_certified"),
    },
    "limit-loads P --contacts 0": {"contacts_without_a_limit", "contacts_not_certified"},
    "stress P --angles 4": set(),
    "perturb P --random 1": {"critical_force_deciles"},
    "informative P --states 40 --best 2 --check 1": set(),
    "load-factor wall.npz --load horizontal --critical": set(),
    "rest P": {"reason"},
    "infer P --measured m.csv --states 8 --certain": set(),
    "import table pile.csv --mu 0.6 --walls floor --gravity 1": {
        *("timestep", "time", "contacts_skipped"),
    },
}
LABELS = {
    "contact",
    "i",
    "j",
    "x",
    "y",
    "n_x",
    "n_y",
    "wall",
}  # columns, and what a report on no packing has


MEANINGS = {
    name: report_lines.line(name).meaning
    for command in (*COMMAND_TABLE, *FORMATS)
    for name in (*command.lines, *command.columns)
}
RARE = {  # of a thin S, of wedges, of measured pressures
    *("directions_taken_as_pinned", "as_narrower_than", "wedged_grains"),
    *("measured_pressures", "suspect_grains"),
}


def test_help_explains_every_line_of_every_report_as_the_store_does(cache, capsys):
    gf.save_packing(packed(12, 0.3), "p.npz")
    gf.save_packing(gf.scene("slope"), "wall.npz")
    Path("m.csv").write_text("contact,f_n,f_t,sigma_n,sigma_t\n0,1,0,0.1,0.1\n")
    Path("pile.csv").write_text("x,y,r\n1,1,1\n3,1,1\n2,2.7320508,1\n")
    for line, elsewhere in COMMANDS.items():
        words = line.replace(" P", " p.npz").split()
        assert main([*words, "--json"]) in (0, 1), line
        told = {name.split(" [")[0] for name in json.loads(capsys.readouterr().out)}
        command = words[: 2 if words[0] == "import" else 1]
        with suppress(SystemExit):
            main([*command, "--help"])
        _, _, explained = capsys.readouterr().out.partition("Lines of the report:\n")
        names = {
            name
            for name in MEANINGS
            if f"  {spaced(name)}  " in f"{explained} " or f"  {spaced(name)}\n" in explained
        }
        assert told - LABELS - {"nearly_touching"} <= names, line
        assert names - told <= elsewhere | LABELS | RARE, line
    stored = {name: VARIABLES[name].long_name for name in MEANINGS if name in VARIABLES}
    for name in ("limit_load", "residual", "violation", "states"):
        stored.pop(name)  # the store has one for each state or contact
    for name in ("coordination", "pressure", "reached"):  # of which help says more
        stored.pop(name)
    assert len(stored) > 25 and stored.items() <= MEANINGS.items()
    assert main("intervals p.npz".split()) == 0
    assert "mean extent of f_n [packing]" in capsys.readouterr().out


def test_a_reader_of_the_report_that_leaves_costs_no_file(cache):
    gf.save_packing(packed(30, 0.3), "p.npz")
    words = "-m granforce intervals p.npz --out bounds.csv"
    reader, writer = os.pipe()
    os.close(reader)  # as `granforce … | head -1`, sooner
    subprocess.run([sys.executable, *words.split()], stdout=writer, stderr=subprocess.DEVNULL)
    os.close(writer)
    assert len(pd.read_csv("bounds.csv")) == len(gf.ensemble(packed(30, 0.3)).index)


def test_a_stress_that_can_be_prescribed_is_reported(cache, capsys):
    gf.save_packing(packing := packed(30, 0.3), "p.npz")
    told = report(capsys, "stress", "p.npz")
    low, high = told["shear_stress_from_to"]
    assert low < told["own_shear_stress"] < high
    words = "intervals p.npz --prescribe stress --stress"
    held = report(capsys, *words.split(), told["admissible_stress"])
    assert held["dimension"] == gf.ensemble(packing).dimension - 2
    assert main("intervals p.npz --stress 1,1,0".split()) == 2
    assert "--prescribe stress" in capsys.readouterr().err


def test_known_forces_of_another_packing_are_refused(cache, capsys):
    assert main(["pack", "-n", "20", "--mu", "0.3", "--seed", "1", "--out", "one.npz"]) == 0
    assert main(["pack", "-n", "20", "--mu", "0.3", "--seed", "2", "--out", "other.npz"]) == 0
    assert main(["intervals", "one.npz", "--contacts", "0,1,2", "--out", "few.csv"]) == 0
    assert main(["intervals", "one.npz", "--contacts", "0", "--known", "few.csv"]) == 0
    capsys.readouterr()
    assert main(["intervals", "other.npz", "--contacts", "0", "--known", "few.csv"]) == 2
    assert "does it belong to another packing?" in capsys.readouterr().err


def test_a_table_in_another_unit_is_refused_where_forces_are_known(cache, capsys):
    Path("known.csv").write_text("contact,f_n [mean]\n0,1\n")
    assert main("intervals -n 20 --mu 0.3 --known known.csv".split()) == 2
    told = capsys.readouterr().err
    assert "f_n [mean]" in told and "--unit packing" in told and told.count("\n") == 1
    Path("known.csv").write_text("contact,f_n_low [packing]\n0,0.5\n")
    assert gf.read_known("known.csv").low.tolist() == [[0.5, -np.inf]]


def test_relaxations_are_typed_as_functions_are_called():
    for name, options in RELAXATIONS.items():
        assert getattr(gf, name.removesuffix("_only")) is options["relax"]
    S = gf.ensemble(reference("n100_mu0.1_s11"))
    named, called = gf.walk(S, 2, relax="nearest_piqp"), gf.walk(S, 2, relax=gf.nearest_piqp)
    assert np.array_equal(named.states, called.states)
    with pytest.raises(gf.InputError, match=r"^relax must be nearest, .*only, got 'newton'$"):
        gf.walk(S, 2, relax="newton")


def test_stored_walks_are_listed_with_the_relaxation_as_typed(cache, capsys):
    assert main(["walk", "-n", "12", "--mu", "0.3", "--states", "2"]) == 0
    capsys.readouterr()
    assert main(["cache", "list", "--kind", "walk", "--json"]) == 0
    (entry,) = json.loads(capsys.readouterr().out)
    assert json.loads(entry["params"])["relax"] == "nearest"
    (stored,) = gf.open_store(cache / "cache").find("walk", relax="nearest")
    assert stored.params["relax"] == "nearest"


def test_results_are_labelled_in_xarray_and_pandas():
    packing = packed(30, 0.3)
    S = gf.ensemble(packing)
    walk, exact = gf.walk(S, 6), gf.intervals(S)
    states = gf.to_dataset(walk, S)["states"]
    assert states.dims == ("state", "contact", "component") and states.units == "force"
    contact = S.index[4]
    one = states.sel(contact=contact, component="f_t")
    assert np.array_equal(one, walk.states[:, 4, 1])
    assert (int(one.i), int(one.j)) == (packing.contacts.i[contact], packing.contacts.j[contact])
    assert [float(one.x), float(one.y)] == packing.contact_points[contact].tolist()
    table = gf.to_dataframe(exact, S).set_index("contact")
    assert table.loc[contact, "f_n_high [packing]"] == exact.high[4, 0]
    assert table.columns[:4].tolist() == ["i", "j", "x", "y"]
    rows = gf.to_dataframe(walk, S)
    assert (
        len(rows) == 6 * len(S.index) and rows["f_n [packing]"].iloc[-1] == walk.states[-1, -1, 0]
    )
    assert len(gf.to_dataframe(packing)) == len(packing.contacts.i)
    for result in (gf.sample_uniform(S, 8), gf.nearest(S, S.original), gf.reach(S, contact)):
        assert len(gf.to_dataframe(result, S)) % len(S.index) == 0
    with pytest.raises(gf.InputError, match=r"gf\.to_dataset\(result, S\)"):
        gf.to_dataset(walk)
    with pytest.raises(gf.InputError, match="belongs to another ensemble: the result of shape"):
        gf.to_dataset(walk, gf.ensemble(gf.scene("groove", 0.5)))


def test_states_of_several_chains_are_drawn_and_labelled_as_they_come():
    S = gf.ensemble(packed(30, 0.3))
    sample = gf.sample_uniform(S, 8)
    assert sample.states.ndim == 4
    assert gf.plot(S.packing, sample.states, "spread", contacts=S.index, backend="matplotlib")
    table = gf.to_dataframe(sample.states, S)
    assert (
        len(table) == 8 * len(S.index) and table["f_n [packing]"].iloc[-1] == sample.flat[-1, -1, 0]
    )
    with pytest.raises(gf.InputError, match=r"contacts=S\.index"):
        gf.plot(S.packing, sample.states[..., 1:, :], contacts=S.index)


@pytest.mark.parametrize("function", [gf.infer, gf.remeasured])
def test_inferred_forces_have_their_means_and_errors_in_tables(function):
    S = gf.ensemble(packed(12, 0.3))
    found = function(S, S.original, 0.1, states=8)
    table = gf.to_dataframe(found, S)
    for k, name in enumerate(("f_n", "f_t")):
        assert table[f"{name}_mean [packing]"].tolist() == found.mean[:, k].tolist()
        assert table[f"{name}_error [packing]"].tolist() == found.error[:, k].tolist()
    assert "f_n_mean [packing]" not in gf.to_dataframe(gf.infer(S, S.original, 0.1), S)


def test_loads_volumes_and_shapes_are_labelled():
    S = gf.ensemble(packed(30, 0.3))
    first, second = (int(contact) for contact in S.index[[1, 4]])
    critical = gf.critical_forces(S, [first, second])
    table = gf.to_dataframe(critical, S).set_index("contact")
    assert table.index.tolist() == [first, second]
    assert table["critical_low [packing]"].tolist() == [one.low for one in critical]
    assert gf.to_dataset(critical[1], S).attrs["limit_load"] == critical[1].limit_load
    loads = gf.limit_loads(S)
    assert gf.to_dataframe(loads, S)["value"].tolist() == loads.tolist()
    assert gf.to_dataframe(gf.limit_load_bounds(S, [first]), S)["contact"].tolist() == [first]
    volume = gf.volume(S, accuracy=0.5)
    assert gf.to_dataset(volume)["ladders"].sel(ladder="up") == volume.ladders[1]
    assert gf.to_dataframe(volume)["log_volume"].tolist() == [volume.log_volume] * 2
    assert "units" not in gf.to_dataset(volume)["error"].attrs  # of ln V
    small = gf.ensemble(gf.scene("groove", 0.5))
    body = gf.body(small)
    labelled = gf.to_dataset(body, small)
    assert labelled["axes"].dims == ("direction", "contact", "component")
    assert labelled["corners"].units == labelled["origin"].units == "force"
    assert len(gf.to_dataframe(body, small)) == len(body.axes) * len(small.index)
    axes = np.zeros((2, len(S.index), 2))
    axes[0, 0, 0] = axes[1, 4, 0] = 1.0
    outline = gf.outline(S, axes, tolerance=0.1)
    corners = gf.to_dataframe(outline)
    assert (corners["polygon"] == "inner").sum() == len(outline.inner)
    for result in (*critical, volume, body, outline, gf.limit_load_bounds(S, [first])):
        assert len(repr(result)) < 400 and "array(" not in repr(result)


def test_a_result_is_printed_in_few_lines():
    S = gf.ensemble(packed(30, 0.3))
    sample = gf.sample_uniform(S, 8)
    results = [S.packing, S, sample, sample.mixing, gf.walk(S, 3), gf.intervals(S)]
    for result in (*results, S.contacts, gf.margin(S.packing), gf.reach(S, S.index[0])):
        assert repr(result).startswith(f"{type(result).__name__}(") and len(repr(result)) < 400
    assert "states[3, " in repr(results[4])


@pytest.mark.parametrize(
    "colour, suffix",
    [("mobilisation", "png"), ("force", "pdf"), ("spread", "png"), ("interval", "pdf")],
)
def test_a_packing_is_drawn_with_states_and_walls(colour, suffix, tmp_path):
    packing = gf.scene("groove", 0.5)
    states = gf.walk(gf.ensemble(packing), 5).states
    figure = gf.plot(packing, states, colour, backend="matplotlib")
    lines = [element for element in figure if type(element).__name__ == "Segments"]
    assert [len(one) for one in lines] == [2, 2]  # two walls, two contacts
    gf.figures.save(figure, tmp_path / f"picture.{suffix}")
    assert (tmp_path / f"picture.{suffix}").stat().st_size > 5000
    with pytest.raises(gf.InputError, match=r"contacts=S\.index"):
        gf.plot(packing, states[:, :1])


def test_the_colour_bar_names_the_quantity_and_its_unit():
    S = gf.ensemble(gf.scene("box", 0.3))
    exact = gf.intervals(S)
    column = gf.to_dataframe(exact, S)["f_n_high [packing]"]

    def bar(colour, **options):
        drawn = list(gf.plot(S.packing, colour=colour, backend="matplotlib", **options))
        return drawn[-1].get_dimension("value").label, drawn[-1].dimension_values("value")

    assert bar(column)[0] == "f_n_high [packing]"
    assert bar(column.to_numpy(), label="largest f_n, N")[0] == "largest f_n, N"
    label, values = bar("interval")
    extent = gf.measures.normal_extent(exact.low, exact.high) / S.force_scale
    assert label == "interval of f_n / ⟨f_n⟩" and sorted(values) == pytest.approx(sorted(extent))
    with pytest.raises(gf.InputError, match="leave it out"):
        bar("force", label="N")
    with pytest.raises(gf.InputError, match="states must be real numbers"):
        gf.plot(S.packing, exact.low.flatten)


def test_the_command_line_draws_a_packing_and_its_states_as_the_library_does(cache, capsys):
    gf.save_packing(packing := packed(12, 0.3), "p.npz")
    S, walk = gf.ensemble(packing), gf.walk(gf.ensemble(packing), 6)
    for suffix in ("csv", "npz", "zarr"):
        assert main(f"walk p.npz --states 6 --out states.{suffix}".split()) == 0
    for words, networks, colour in (
        ("", {}, "mobilisation"),
        ("--states states.csv --colour spread", {"states": walk.states}, "spread"),
        ("--states states.npz --state 3 --colour force", {"states": walk.states[3]}, "force"),
        ("--states states.zarr --state 4 --colour force", {"states": walk.states[4]}, "force"),
    ):
        assert not main(f"plot p.npz --out command.svg {words}".split())
        contacts = {"contacts": S.index} if networks else {}
        gf.figures.save(
            gf.plot(packing, colour=colour, backend="matplotlib", **networks, **contacts), "own.svg"
        )
        assert Path("command.svg").read_bytes() == Path("own.svg").read_bytes()
    assert not main("plot p.npz --out p.pdf".split())
    assert Path("p.pdf").read_bytes().startswith(b"%PDF")


def test_the_command_line_draws_bodies(cache, capsys):
    assert not main("pack --scene slope --out slope.npz".split())
    assert not main("plot slope.npz --out slope.png".split())
    assert Path("slope.png").stat().st_size > 5000


def test_pictures_that_make_no_sense_are_refused(cache, capsys):
    gf.save_packing(packed(30, 0.3), "p.npz")
    gf.save_packing(packed(20, 0.3), "other.npz")
    assert main("walk p.npz --states 3 --out states.npz".split()) == 0
    assert main("walk p.npz --states 3 --unit mean --out mean.csv".split()) == 0
    before = sorted(cache.iterdir())
    for words, said in (
        ("p.npz --out p.jpg", "must end with .png, .svg, .pdf or .html"),
        ("p.npz --out p.npz", "would overwrite"),
        ("p.npz --out p.png --colour spread", "--colour spread needs several networks"),
        ("p.npz --out p.png --states states.npz --state 3", "--state must be at most 2"),
        ("other.npz --out p.png --states states.npz", "states.npz: "),
        ("p.npz --out p.png --states mean.csv", "--unit packing"),
        ("p.npz --out p.png --states p.npz", "no states"),
        ("p.npz --out p.png --state 3", "--state has no effect without --states"),
    ):
        capsys.readouterr()
        with suppress(SystemExit):
            assert main(["plot", *words.split()]) == 2
        told = capsys.readouterr().err
        assert said in told and told.count("\n") == 1, words
    assert sorted(cache.iterdir()) == before


def test_the_mean_normal_force_has_one_meaning():
    """Plain means are off in this packing: of all contacts by 3 %, of those of S by 0.5 %."""
    packing = reference("n100_mu1_s12")
    S = gf.ensemble(packing)
    mean = np.average(S.original[:, 0], weights=S.contacts.length)
    assert S.force_scale == pytest.approx(mean) != pytest.approx(packing.forces[:, 0].mean())
    assert gf.report(packing)["mean_normal_force"] == S.force_scale
    assert f"⟨f_n⟩ = {mean:.4g}" in title(gf.plot(packing, colour="force", backend="matplotlib"))
    states = S.original[None]
    figure = gf.plot(packing, states, "force", contacts=S.index, backend="matplotlib")
    assert f"⟨f_n⟩ = {mean:.4g}" in title(figure)
    assert f"{packing.forces[:, 0].mean():.4g}" not in packing._repr_svg_()


def test_the_colour_bar_has_an_arrow_only_where_values_lie_beyond_it(monkeypatch):
    def refuse(packing):
        raise AssertionError("an ensemble is built for widths alone")

    monkeypatch.setattr(picture, "ensemble", refuse)
    packing = reference("n100_mu0.1_s11")
    forces = packing.forces.copy()
    forces[:, 1] = packing.mu * forces[:, 0] * (1 + 1e-12) * np.where(forces[:, 1] < 0, -1, 1)
    for factor, seen in ((1.0, 1.0), (2.0, pytest.approx(2.0))):
        forces[np.argmax(forces[:, 0]), 1] *= factor
        drawn = gf.plot(packing._replace(forces=forces), backend="matplotlib")
        (lines,) = (one for one in drawn if "w" in one.dimensions("value", label=True))
        assert np.abs(lines.dimension_values("value")).max() == seen


def title(figure):
    return hv.render(figure, backend="matplotlib").axes[0].get_title().replace("$", "")


def test_grains_are_counted_without_walls_and_rattlers_are_the_others(cache, capsys):
    pile = pd.DataFrame({"x": [1, 3, 5, 2, 9], "y": [1, 1, 1, 1 + 3**0.5, 7], "r": 1.0})
    pile.iloc[:4].to_csv("grains.csv", index=False)
    told = report(
        capsys, *"import table grains.csv --mu 0.6 --gravity 2 --walls floor --out p.npz".split()
    )
    packing = gf.load_packing("p.npz")
    assert len(packing.r) > told["grains"] == 4
    for counted in (told, gf.report(packing)):
        assert counted["grains"] == counted["backbone_grains"] + counted["rattlers"] == 4
        assert counted["grains_left_open"] == len(packing.r) - 4
    # A wall on which nothing presses is no rattler.
    slack = gf.scene("box", 0.3)
    free = slack._replace(x=np.vstack([slack.x, [[50.0, 50.0]]]), r=np.append(slack.r, 1.0))
    free = free._replace(load=np.vstack([slack.load, [[np.nan] * 3]]))
    assert gf.ensemble(free).skipped["rattlers"] == gf.ensemble(slack).skipped["rattlers"] == 0


def test_tables_of_pandas_are_read_where_those_of_the_command_line_are(cache, capsys):
    gf.save_packing(packing := packed(30, 0.3), "p.npz")
    S = gf.ensemble(packing)
    exact = gf.intervals(S)
    table = gf.to_dataframe(exact, S)
    assert main("intervals p.npz --out bounds.csv".split()) == 0
    with pytest.raises(gf.InputError, match=r"as in gf\.to_dataframe\(result, S\)"):
        gf.to_dataframe(exact)
    written = pd.read_csv("bounds.csv")
    assert [*table.columns] == [*written.columns]
    assert table["cluster"].tolist() == written["cluster"].tolist()
    table.to_csv("known.csv")  # with the index of pandas as a column without a name
    known = gf.read_known("known.csv")
    assert np.array_equal(known.low, exact.low) and np.array_equal(known.contacts, S.index)
    capsys.readouterr()
    told = report(capsys, *"intervals p.npz --known known.csv".split())
    assert told["dimension"] == S.dimension
    walk = gf.walk(S, 3)
    gf.to_dataframe(walk, S).to_csv("states.csv")
    assert not main("plot p.npz --states states.csv --out p.png".split())
    gf.to_dataframe(packing).to_csv("contacts.csv")
    pd.DataFrame({"x": packing.x[:, 0], "y": packing.x[:, 1], "r": packing.r}).to_csv("grains.csv")
    again = gf.read_table("grains.csv", "contacts.csv", mu=0.3, box=packing.box)
    assert np.array_equal(again.forces, packing.forces)
    Path("other.csv").write_text("contact,f_n_low [packing],f_n_deviation [sigma]\n0,0.5,1\n")
    assert gf.read_known("other.csv").low.tolist() == [[0.5, -np.inf]]


@pytest.mark.parametrize("unit, units", [("packing", "force"), ("mean", "mean normal force")])
def test_datasets_have_units_and_the_names_of_the_library(unit, units, cache, capsys):
    gf.save_packing(packing := packed(30, 0.3), "p.npz")
    S = gf.ensemble(packing)
    scale = 1 if unit == "packing" else S.force_scale
    exact = gf.to_dataset(gf.intervals(S), S)
    for command in ("intervals", "limit-loads", "measure --states 4", "walk --states 4"):
        words = f"{command} p.npz --unit {unit} --out {command[:4]}.zarr"
        assert not main(words.split())
        dataset = xr.open_zarr(f"{command[:4]}.zarr")
        for values in dataset.data_vars.values():
            fixed = {"cluster": "1", "gap": "mean normal force"}
            assert values.attrs["units"] == fixed.get(values.name, units)
    low = xr.open_zarr("inte.zarr")["low"]
    assert low.dims == exact["low"].dims and np.allclose(low * scale, exact["low"], atol=1e-9)
    assert xr.open_zarr("limi.zarr")["limit_load"].dims == ("contact",)
    assert xr.open_zarr("inte.zarr")["x"].attrs["units"] == "length"


def test_a_stress_that_can_be_carried_is_found_by_name(cache, capsys):
    gf.save_packing(packing := packed(30, 0.3), "p.npz")
    S = gf.ensemble(packing)
    stress = gf.admissible_stress(S)
    told = report(capsys, *"stress p.npz".split())["admissible_stress"]
    assert stress == pytest.approx([float(part) for part in told.split(",")], rel=1e-6)
    assert stress[:2].sum() == pytest.approx(2 * packing.pressure)
    held = gf.ensemble(packing, prescribed="stress", stress=stress)
    assert held.dimension == S.dimension - 2
    assert "admissible_stress" in dir(gf)


def test_help_explains_the_fields_of_records_with_their_units():
    records = [
        kind
        for name in gf.__all__
        if isinstance(kind := getattr(gf, name), type) and hasattr(kind, "_fields")
    ]
    assert len(records) > 30
    for record in records:
        for name in record._fields:
            assert not getattr(record, name).__doc__.startswith("Alias"), (record, name)
    told = pydoc.render_doc(gf.Intervals, renderer=pydoc.plaintext)
    low = "low: (contact, component) smallest value, force; −inf without a limit; NaN: cancelled"
    assert low in told and told.index(low) < told.index("Method resolution order")
    above = pydoc.render_doc(gf.Packing, renderer=pydoc.plaintext)
    assert "of bodies other than disks; x are then centres of mass" in above
    assert "backbone, as positions in packing.x" in pydoc.render_doc(gf.Ensemble)


@pytest.mark.parametrize("command", ["walk", "uniform"])
def test_states_are_written_in_the_format_of_the_suffix(command, cache, capsys):
    gf.save_packing(packed(30, 0.3), "p.npz")
    words = [command, "p.npz", "--states", "8"]
    for suffix in ("csv", "npz", "zarr"):
        assert main([*words, "--out", f"states.{suffix}"]) == 0
    table, arrays = pd.read_csv("states.csv"), np.load("states.npz")
    dataset, S = xr.open_zarr("states.zarr"), gf.ensemble(packed(30, 0.3))
    states = arrays["states [packing]"]
    assert np.array_equal(dataset["states"], states) and len(states) >= 8
    assert dataset["states"].attrs["units"] == "force"
    assert np.array_equal(dataset["contact"], S.index) and S.residual(states).max() < 1e-9
    assert np.allclose(table["f_t [packing]"], states[..., 1].ravel(), rtol=1e-15)
    assert np.array_equal(table["j"][: len(S.index)], S.contacts.j)
    assert main([*words, "--out", "mean.csv", "--unit", "mean"]) == 0
    mean = pd.read_csv("mean.csv")["f_n [mean]"] * S.force_scale
    assert np.allclose(mean, table["f_n [packing]"], rtol=1e-12)


def test_a_suffix_that_is_not_known_is_refused(cache, capsys):
    for words in ("pack -n 20 --mu 0.3 --out p.csv", "walk -n 20 --mu 0.3 --out states.xlsx"):
        assert main(words.split()) == 2
        told = capsys.readouterr().err
        assert "the name must end with .npz" in told or ".csv, .npz or .zarr" in told
    assert list(cache.iterdir()) == []


def test_a_pile_of_own_disks_stands_on_its_floor_from_tables_and_from_arrays(cache, capsys):
    x = np.array([[1, 1], [3, 1], [5, 1], [2, 1 + 3**0.5], [4, 1 + 3**0.5]])
    table = pd.DataFrame({"x": x[:, 0], "y": x[:, 1], "r": 1.0})
    table.to_csv("grains.csv", index=False)
    words = "import table grains.csv --mu 0.6 --gravity 2 --out pile.npz --walls"
    told = report(capsys, *words.split(), "floor")
    assert [told[name] for name in ("grains", "contacts_with_walls", "dimension")] == [5, 3, 5]
    assert str(told["largest_overlap"]) == "0.0"
    packing = gf.from_disks(x, np.ones(5), 0.6, walls="floor", gravity=2)
    assert np.array_equal(gf.load_packing("pile.npz").forces, packing.forces)
    floor = packing.contacts.j >= 5
    assert packing.forces[floor, 0].sum() == pytest.approx(5 * 2 * np.pi)
    assert packing.contact_points[floor][:, 1] == pytest.approx([0, 0, 0], abs=1e-12)
    exact = gf.intervals(gf.ensemble(packing))
    assert exact.converged and np.all(exact.low[floor, 0] > 0)
    same = report(capsys, *words.split(), "0,0,6,0")
    assert same["mean_normal_force [packing]"] == pytest.approx(told["mean_normal_force [packing]"])
    table.assign(open=[1, 1, 1, 0, 0]).to_csv("grains.csv", index=False)
    glued = report(capsys, *"import table grains.csv --mu 0.6 --gravity 2 --out g.npz".split())
    assert glued["backbone_grains"] == 2
    for wrong in ("lid", "0,0,6"):
        with suppress(SystemExit):
            assert main([*words.split(), wrong]) == 2
        assert capsys.readouterr().err.count("\n") == 1
    assert main(f"{words} floor --box 9 9".split()) == 2
    assert "leave out the box" in capsys.readouterr().err


def test_what_is_not_defined_is_said_so_and_0_is_no_packing_fraction(cache, capsys):
    packing = gf.from_disks(
        [[1, 1], [3, 1], [2, 2.7320508]], np.ones(3), 0.6, walls="floor", gravity=1
    )
    gf.save_packing(packing, "pile.npz")
    assert np.isnan(packing.packing_fraction)
    for command in ("walk --states 4", "measure --states 4", "uniform --states 8"):
        words = [*command.split(), "pile.npz"]
        assert report(capsys, *words)["packing_fraction"] is None
        assert main(words) == 0
        told = capsys.readouterr().out
        assert "nan" not in told.split() and "undefined" in told


def test_what_to_measure_next(cache, capsys):
    gf.save_packing(packed(30, 0.3), "p.npz")
    words = "informative p.npz --best 4 --check 2 --states 100 --out next.csv"
    told = report(capsys, *words.split())
    S = gf.ensemble(packed(30, 0.3))
    best = gf.informative(S, 4, states=100, check=2)
    assert told["contact"] == best.contacts.tolist()
    assert told["reduction"][:2] == best.reduction[:2].tolist()
    assert told["reduction"][0] == pytest.approx(1 - best.after[0] / best.before)
    assert {"expected_reduction", "reduction"} <= set(gf.to_dataframe(best, S).columns) & set(told)
    assert told["twins"] == [list(others) for others in best.twins]
    assert told["mean_interval_after [packing]"][0] < told["mean_interval_now [packing]"]
    assert main(words.split()) == 0
    *_, heads, first, _, _, _ = capsys.readouterr().out.splitlines()
    assert heads.split()[:5] == ["contact", "i", "j", "x", "y"]
    assert int(first.split()[0]) == best.contacts[0]
    table = pd.read_csv("next.csv")
    assert table["contact"].tolist() == told["contact"]
    assert table["number_of_twins"].tolist() == [len(others) for others in best.twins]


def test_the_store_says_where_it_is_and_makes_nothing(cache, capsys):
    assert main(["cache", "path"]) == 0
    assert capsys.readouterr().out == f"{cache / 'cache'}\n"
    assert list(cache.iterdir()) == []


@pytest.mark.parametrize("asked", [True, False])
def test_the_library_logs_that_it_compiles_and_is_silent_by_default(asked):
    code = (
        "import logging\n"
        f"if {asked}: logging.basicConfig(level=logging.INFO)\n"
        "import granforce.numerics.lanes, numba\n"
        "numba.njit(lambda x: x + 1)(1)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    said = "INFO:granforce:compiling kernels, once per machine\n"
    assert run.stderr == (said if asked else "")


def test_figure_1_is_drawn_from_the_store_of_a_scan(tmp_path, capsys):
    store, out = str(tmp_path / "scan.zarr"), str(tmp_path / "figure1")
    scan = ["scan", "-n", "12", "--states", "3", "--workers", "1", "--out", store]
    assert main([*scan, "--mu", "0.3,1"]) == 0
    assert main(["figures", store, "--out", f"{out}.svg"]) in (0, None)
    assert "</svg>" in Path(f"{out}.svg").read_text()
    drawn = gf.figures.indeterminacy(gf.open_store(store), backend="matplotlib")
    rows = scan_rows(gf.open_store(store))
    assert [row["mu"] for row in rows] == [0.3, 1] and len(drawn)
    assert main(["scan", "-n", "14", *scan[3:], "--mu", "0.3"]) == 0
    capsys.readouterr()
    assert main(["figures", store, "--out", f"{out}.png"]) == 2
    assert "differ in n;" in capsys.readouterr().err and not Path(f"{out}.png").exists()


@pytest.mark.parametrize(
    "line, said",
    [
        ("scan --mu 0.1 0.2", "--mu: separate values by commas, as in --mu 0.1,0.2;"),
        ("pack --mu 0.1 0.2", "--mu takes one value, not 0.1 and 0.2;"),
        ("interval --mu 0.1", "command 'interval' is unknown; did you mean intervals?;"),
        ("walk --mu 0.1 --stats 5", "there is no option --stats; did you mean --states?;"),
        ("walk --mu 0.1 --relax=neares", "--relax 'neares' is unknown; did you mean nearest?;"),
        ("walk --mu 0.1 --relax magic", "--relax 'magic' is unknown; choose from nearest, "),
        ("pack --mu 0.1 --colour", "unrecognized arguments: --colour;"),
        ("pack extra", "unrecognized arguments: extra;"),
    ],
)
def test_slips_of_the_keyboard_are_answered_with_what_was_meant(line, said, capsys):
    with pytest.raises(SystemExit) as stop:
        main(line.split())
    told = capsys.readouterr()
    assert stop.value.code == 2 and told.out == ""
    assert told.err.startswith(f"granforce: {said}") and told.err.count("\n") == 1


def test_no_command_is_the_plural_of_another():
    commands = make_parser()._subparsers._group_actions[0].choices
    assert "limit-loads" in commands
    assert not {f"{name}s" for name in commands} & commands.keys()


def test_every_text_defines_eta3_alike():
    """As PRE 79, 052302: the mean length of intervals over the mean of their midpoints."""
    words = "divided by the mean of their midpoints"
    readme = " ".join((Path(__file__).parents[1] / "README.md").read_text().split())
    assert words in readme and words in TERMS["eta3"].sentence
    assert words in " ".join(gf.measures.eta3.__doc__.split())
    low, high = np.array([[1.0, -1.0], [2.0, 0.0]]), np.array([[3.0, 1.0], [2.0, 4.0]])
    assert gf.measures.eta3(low, high) == pytest.approx(((2 + 2 + 0 + 4) / 4) / ((2 + 2 + 2) / 4))


def test_disks_without_support_are_answered_with_walls_and_gravity(cache, capsys):
    Path("pile.csv").write_text("x,y,r\n1,1,1\n3,1,1\n2,2.7320508,1\n")
    for words, said in (([], "--walls floor --gravity 1"), (["--gravity", "1"], "--walls floor")):
        assert main(["import", "table", "pile.csv", "--mu", "0.6", *words]) == 2
        error = capsys.readouterr().err
        assert said in error and error.count("\n") == 1
    rows = "i,j,fn,ft\n0,2,0.9,0.1\n1,2,0.9,-0.1\n"
    Path("forces.csv").write_text(rows)
    assert main(["import", "table", "pile.csv", "forces.csv", "--mu", "0.6"]) == 0
    told = capsys.readouterr().err
    assert "contacts do not balance 3 of 3 grains" in told and "--walls and --gravity" in told
    with pytest.raises(gf.NotJammedError, match="walls="):
        gf.from_disks([[1, 1], [3, 1]], [1, 1], mu=0.6, gravity=1)


def test_overlaps_and_pairs_in_doubt_are_noted_and_listed(cache, capsys):
    """Three soft disks on a floor; the third is 5·10⁻⁵ from the second."""
    Path("soft.csv").write_text("x,y,r\n1,1,1\n2.98,1,1\n4.98005,1,1\n")
    words = ["import", "table", "soft.csv", "--mu", "0.6", "--walls", "floor", "--gravity", "1"]
    assert main([*words, "--json"]) == 0
    told = capsys.readouterr()
    assert "disks overlap by up to 0.02 of the largest radius (mean 0.02)" in told.err
    assert "1 pair is in doubt: gaps below 0.0001 of" in told.err
    ((i, j, gap),) = json.loads(told.out)["nearly_touching"]
    assert (i, j) == (1, 2) and gap == pytest.approx(5e-5, rel=1e-6)
    assert main([*words, "--tolerance", "1e-4"]) == 0  # now they touch
    assert "in doubt" not in capsys.readouterr().err
    rigid = gf.from_disks([[1, 1], [3, 1]], [1, 1], mu=0.6, walls="floor", gravity=1)
    assert rigid.info["nearly_touching"] == [] and "notes" not in rigid.info


def test_the_library_scans_the_cells_of_the_command(cache):
    """The walk that the command stores is a cell of the scan: no process starts."""
    walk = ["walk", "-n", "12", "--mu", "0.3", "--states", "3", "--radii", "uniform:0.8,1"]
    assert main([*walk, "--cache", "s.zarr"]) == 0
    rows, failed = gf.scan("s.zarr", [0.3], n=12, states=3, radii="uniform:0.8,1")
    (entry,) = gf.open_store("s.zarr").find("walk")
    assert not failed and rows == scan_rows(gf.open_store("s.zarr"))
    assert rows[0]["cached"] and rows[0]["eta1"] == gf.open_store("s.zarr")[entry.name]["eta1"]
    for wrong, said in (
        ({"relax": "accelerated"}, "relax must be nearest"),
        ({"seeds": 0}, "seeds must be at least 1"),
        ({"workers": 0}, "workers"),
        ({"states": 0}, "states"),
    ):
        with pytest.raises(gf.InputError, match=said):
            gf.scan("s.zarr", [0.3], **{"n": 12, **wrong})


@pytest.mark.parametrize("walls", ["floor", "box"])
def test_walls_on_which_nothing_presses_are_refused_with_what_to_add(walls):
    with pytest.raises(gf.InputError, match=r"add gravity \(--gravity 1, or gravity=1\)"):
        gf.from_disks([[0.5, 0.5], [0.5, 1.5]], [0.5, 0.5], mu=0.5, walls=walls)


def test_a_sample_that_is_too_small_is_noted(cache, capsys):
    gf.save_packing(packed(12, 0.3), "p.npz")
    Path("m.csv").write_text("contact,f_n,f_t,sigma_n,sigma_t\n0,1,0,0.1,0.1\n")
    for command in ("uniform p.npz", "infer p.npz --measured m.csv"):
        assert main([*command.split(), "--states", "8"]) == 0
        told = capsys.readouterr().err.splitlines()[-1]
        assert told.startswith("granforce: the sample is unreliable: ") and "--states" in told
    assert main("uniform p.npz --states 600".split()) == 0
    assert "unreliable" not in capsys.readouterr().err


def test_numbers_per_contact_bound_the_normal_force_alone():
    packing = gf.scene("groove", 0.3)

    def bounds(*known, **sides):
        exact = gf.intervals(gf.ensemble(packing, known=gf.Known(*known, **sides)))
        return exact.low.tolist(), exact.high.tolist()

    for brief, full in (
        (([0], [0.6]), ([0], [[0.6, -np.inf]])),
        ((0, 0.6, 0.6), ([0], [[0.6, -np.inf]], [[0.6, np.inf]])),
        (([0, 1], [0.5, 0.6]), ([0, 1], [[0.5, -np.inf], [0.6, -np.inf]])),
    ):
        assert bounds(*brief) == bounds(*full)
    assert bounds([0], high=[0.6]) == bounds([0], [[-np.inf] * 2], [[0.6, np.inf]])
    for wrong in (gf.Known([0, 1, 2], [0.5, 0.6]), {13: 0.05}):
        with pytest.raises(gf.InputError, match=r"f_n alone, as in gf\.Known\("):
            gf.ensemble(packing, known=wrong)


@pytest.mark.parametrize(
    "command, columns",
    [
        ("intervals", ["f_n low [packing]", "f_t low [packing]", "f_n high [packing]"]),
        ("limit-loads", ["limit load [packing]"]),
        ("perturb", ["limit load [packing]", "critical low [packing]", "critical high [packing]"]),
    ],
)
def test_few_contacts_are_listed_under_the_report(command, columns, cache, capsys):
    gf.save_packing(packing := packed(12, 0.3), "p.npz")
    first, second = gf.ensemble(packing).index[[0, 4]]
    words = f"{command} p.npz --contacts {second},{first} --out t.csv"
    assert main(words.split()) == 0
    told = capsys.readouterr().out
    *_, heads, one, _ = told.splitlines()
    assert heads.startswith("contact") and int(one.split()[0]) in (first, second)
    assert all(column in heads for column in columns) and "deciles" not in told
    told = report(capsys, *words.split())
    assert sorted(told["contact"]) == [first, second]
    written = pd.read_csv("t.csv")[columns[-1].replace(" ", "_", columns[-1].count(" ") - 1)]
    assert told[written.name] == written.tolist()
    if command == "perturb":
        assert told["fit_range"] is None or np.all(np.diff(told["fit_range"]) > 0)


@pytest.fixture
def pile():
    """A pile of three disks on a floor, under gravity."""
    x = [[1, 1], [3, 1], [2, 1 + 3**0.5]]
    return gf.from_disks(x, np.ones(3), 0.6, walls="floor", gravity=1)


def test_a_packing_is_tested_for_rest_and_the_reason_is_given(pile, cache, capsys):
    gf.save_packing(pile, "pile.npz")
    told = report(capsys, "rest", "pile.npz")
    assert told["at_rest"] is True and "reason" not in told and told["draws_at_rest"] == [3, 3]
    assert gf.rest(pile).reason == ""
    rows = [(0.5 * (1 + k) + i, 0.5 + k * 0.75**0.5) for k in range(3) for i in range(5 - k)]
    heap = gf.rest(gf.from_disks(rows, np.full(12, 0.5), 0.5, walls="floor", gravity=1))
    assert not heap.at_rest and heap.reason[:30] in repr(heap) and not np.isnan(heap.distance)
    assert re.fullmatch(r"grains move in 1 of 3 draws with noise of 0.01 ⟨f_n⟩", heap.reason)


def test_conditions_of_a_periodic_box_are_refused_in_an_open_one(pile, cache, capsys):
    gf.save_packing(pile, "pile.npz")
    for words, said in (
        ("stress pile.npz", "in a periodic box only; this box is open"),
        ("intervals pile.npz --prescribe pressure", "leave it out"),
        ("intervals pile.npz --mu 0.3", "or use --ensemble-mu for other Coulomb cones"),
        ("pack --friction 0.1", "did you mean --mu?"),
        ("critical-load pile.npz", "did you mean load-factor --critical?"),
    ):
        with suppress(SystemExit):
            assert main(words.split()) == 2
        told = capsys.readouterr().err
        assert said in told and told.count("\n") == 1, words


def test_lines_of_reports_have_names_in_words_and_no_stray_underscore(capsys):
    words = {spaced(name) for name in MEANINGS}
    assert not words & {"again", "programs", "turns", "held", "grains left open"}
    assert spaced("unbalance_saved_if_tangential_forces") == "unbalance saved if tangential forces"
    assert spaced("mean_change_of_f_n") == "mean change of f_n"
    terminal.print_report({"again": 1, "programs": 2}, False)
    assert len({line.rindex(" ") for line in capsys.readouterr().out.splitlines()}) == 1


def test_help_and_pages_agree_with_what_is_done():
    assert gf.Volume.__doc__.count("log_volume:") == 1
    assert "plain mean" in MEANINGS["mean_normal_force"]
    assert "plain mean" in TERMS["mean_force"].sentence
    howto = Path(gf.__file__).parent / "docs/pages/howto/own-packings.md"
    assert all(f"`{name}`" in howto.read_text() for name in SCENES)
    with pytest.raises(gf.InputError, match=r"^an Ensemble cannot be labelled"):
        gf.to_dataset(gf.ensemble(gf.scene("groove")))


def test_a_record_of_the_wrong_type_is_named_in_plain_words():
    message = r"^intervals takes an Ensemble, not a Packing; make one first: S = gf\.ensemble"
    with pytest.raises(gf.InputError, match=message):
        gf.intervals(gf.scene("groove"))


def test_the_report_of_a_photoelastic_frame_is_explained(capsys):
    with suppress(SystemExit):
        main(["import", "pegs", "--help"])
    told = capsys.readouterr().out
    assert "Lines of the report:" in told and "  candidates that carry" in told
    assert "chosen so that χ² equals its degrees of freedom" in " ".join(told.split())
    assert list(with_units({"error": 1.0})) == ["error [mean measured]"]


def test_tables_are_in_either_unit():
    S = gf.ensemble(gf.scene("groove"))
    bounds = gf.intervals(S)
    table, mean = gf.to_dataframe(bounds, S), gf.to_dataframe(bounds, S, unit="mean")
    high = table["f_n_high [packing]"].to_numpy()
    assert mean["f_n_high [mean]"].to_numpy() == pytest.approx(high / S.force_scale)
    assert "f_n_high [packing]" not in mean and S.force_scale != 1
    force, dataset = bounds.high / S.force_scale, gf.to_dataset(bounds, S, unit="mean")
    assert np.array_equal(dataset["high"], force, equal_nan=True)
    assert dataset["high"].units == "mean normal force"
    for name, options in {"unit must be": {"unit": "N"}, "needs S": {"unit": "mean"}}.items():
        with pytest.raises(gf.InputError, match=name):
            gf.to_dataframe(S.packing, **options)


def _results(S):
    """Results of every kind with forces, by name."""
    contact = S.index[3]
    reach = gf.reach(S, contact)
    return {
        "intervals": gf.intervals(S),
        "limit loads": gf.limit_load_bounds(S),
        "critical force": gf.critical_force(S, contact),
        "critical forces": gf.critical_forces(S, S.index[:2]),
        "reach": reach,
        "pull": gf.pull(S, contact, [0.5 * (reach.low + reach.high)]),
        "informative": gf.informative(S, 2),
        "walk": gf.walk(S, 3, seed=0),
        "uniform": gf.sample_uniform(S, 4, seed=0),
    }


def test_in_mean_forces_nothing_depends_on_the_unit_of_pressure():
    """Numbers, labels and attributes: under another pressure, all are the same."""
    ensembles = [gf.ensemble(gf.pack(20, 0.3, 2, pressure=pressure)) for pressure in (1, 4096)]
    small, large = (_results(S) for S in ensembles)
    for name, one in small.items():
        a = gf.to_dataset(one, ensembles[0], unit="mean")
        b = gf.to_dataset(large[name], ensembles[1], unit="mean")
        for variable in a.variables:
            if a[variable].dtype.kind == "f" and variable not in ("gap", "residual", "violation"):
                np.testing.assert_allclose(a[variable], b[variable], rtol=1e-6, atol=1e-6)
        for attribute, value in a.attrs.items():
            if isinstance(value, float) and "seconds" not in attribute:
                assert b.attrs[attribute] == pytest.approx(value, rel=1e-6, abs=1e-6), (
                    name,
                    attribute,
                )


def test_an_outline_of_stresses_is_labelled_as_the_command_writes_it(cache, capsys):
    assert main("stress -n 30 --mu 0.3 --angles 5 --out s.csv".split()) == 0
    assert main("stress -n 30 --mu 0.3 --angles 5 --out s.zarr".split()) == 0
    outline = gf.stress_outline(gf.ensemble(gf.pack(30, 0.3)), 5)
    pd.testing.assert_frame_equal(gf.to_dataframe(outline), pd.read_csv("s.csv"))
    written, labelled = xr.open_zarr("s.zarr", consolidated=False), gf.to_dataset(outline)
    xr.testing.assert_equal(written, labelled)
    assert labelled["angle"].units == written["angle"].units == "rad"
    assert labelled["largest"].units == written["largest"].units == "pressure"
    assert labelled.attrs["friction"] == outline.friction


def test_wrong_arguments_are_named_with_what_to_give(tmp_path):
    assert issubclass(gf.UnboundedError, gf.InputError)
    S = gf.ensemble(gf.scene("groove"))
    with pytest.raises(gf.InputError, match=r"open_store"):
        gf.figures.indeterminacy("scan.zarr")
    with pytest.raises(TypeError, match=r"^walk has no option 'start'; its .* are states, seed, "):
        gf.walk(S, 5, start=3)
    with pytest.raises(TypeError, match=r"^(?!.*cancel.*cancel)"):
        gf.walk(S, 5, state=5)
    with pytest.raises(gf.InputError, match=r"save takes a HoloViews figure, not an int"):
        gf.figures.save(3, tmp_path / "x.png")
    with pytest.raises(gf.InputError, match=r"drawn for bokeh, .* backend=\"matplotlib\""):
        gf.figures.save(gf.plot(S.packing), tmp_path / "x.png")
    with pytest.raises(gf.InputError, match="needs several networks"):
        gf.plot(S.packing, colour="spread")
    with pytest.raises(gf.InputError, match=r"stored in a folder, such as s\.zarr"):
        gf.scan(tmp_path / "s.csv", 0.3)
    with pytest.raises(gf.InputError, match=r"unit=\"mean\" changes nothing here"):
        gf.to_dataframe(gf.limit_loads(S), S, unit="mean")
    with pytest.raises(TypeError, match=r"^scan has no option 'N'; its options are seeds, n, .*dt"):
        gf.scan(tmp_path / "s.zarr", [0.1], N=30)
    with pytest.raises(TypeError, match=r"^critical_force has no option 'preciion'; .*precision"):
        gf.critical_force(S, 0, preciion=1)
    with pytest.raises(gf.InputError, match=r"coefficient must be a number, got '0\.1'"):
        gf.pack(30, "0.1")
    with pytest.raises(gf.InputError, match=r"pressure must be a number, got '2'"):
        gf.pack(30, 0.1, pressure="2")
    with pytest.raises(gf.InputError, match=r"radii must have shape \(N,\), got \(\)"):
        gf.from_disks([[0, 1], [2, 1]], 1.0, 0.3)
    with pytest.raises(gf.InputError, match=r"labelled by the ensemble"):
        gf.to_dataframe(gf.informative(S, states=8, check=0))
    with pytest.raises(gf.InputError, match=r"array of 1 contacts .* S has 2 .*limit_load_bounds"):
        gf.to_dataframe(gf.limit_loads(S, S.index[:1]), S)


def test_slips_in_python_are_answered_with_what_to_give(tmp_path):
    S, disks = gf.ensemble(gf.scene("groove")), ([[1, 1], [3, 1]], [1, 1], 0.6)
    packing, field = S.packing, np.zeros((2, 2))
    square = [[0, 0], [1, 0], [1, 1], [0, 1]]
    draw, same = gf.figures, tmp_path / "same.vtk"
    slips = {
        "a path must be text or a pathlib.Path, got 1": lambda: gf.load_packing(1),
        "a path must be text or a pathlib.Path, got None": lambda: gf.read_table(None, mu=0.3),
        f"{same}: give each of the two files": lambda: gf.save_vtk(packing, same, same),
        "pressure applies to periodic boxes": lambda: gf.from_disks(
            *disks, walls="floor", gravity=1, pressure=3
        ),
        "pressure applies to periodic boxes without forces": lambda: gf.read_table(
            *square_lattice(1, 0, 0), mu=0.3, box=[3, 3], pressure=2
        ),
        "tolerance has no effect": lambda: gf.read_table(
            *square_lattice(1, 0, 0), mu=0.3, box=[3, 3], tolerance=1e-5
        ),
        "walls must be a regular array": lambda: gf.from_disks(*disks, walls=packing, gravity=1),
        "make_packing takes a Contacts, not 3": lambda: gf.make_packing(*packing[:3], 3, [], 0.3),
        "bodies must be a list": lambda: gf.blocks(3, 0.5),
        "friction must be {": lambda: gf.blocks([square], 0.5, fixed=[0], friction=0.3),
        "give the name of each": lambda: gf.blocks([square], 0.5, fixed=[0], names=[]),
        "contacts must be a list of numbers from 0 to 1": lambda: gf.plot(packing, contacts=[-1]),
        "displacements must have shape": lambda: draw.displacement(packing, field),
        "compare must be {name: rows}": lambda: draw.indeterminacy([{"mu": 0.1}], compare=3),
        "mu must be real numbers, got text": lambda: draw.indeterminacy([{"mu": "x"}]),
        "every sigma is NaN": lambda: gf.infer(S, S.original, np.nan),
        "states must have shape": lambda: gf.measures.sampling(np.zeros((4, 30, 2, 2))),
        "state must have shape": lambda: gf.measures.Growth().add(np.zeros((3, 2, 2))),
        "give at least one friction": lambda: gf.scan(tmp_path / "s.zarr", []),
        "mu 0.1 is given twice": lambda: gf.scan(tmp_path / "s.zarr", [0.1, 0.2, 0.1]),
        "known must be Known": lambda: gf.ensemble(packing, known=gf.Known(field, [0], [1])),
    }
    for said, slip in slips.items():
        with pytest.raises(gf.InputError) as answer:
            slip()
        assert str(answer.value).startswith(said)
    np.savez(tmp_path / "states.npz", **{"states [packing]": np.zeros((1, 2, 2))})
    with pytest.raises(gf.InputError, match=r"states\.npz: these are networks; give the file of"):
        gf.load_packing(tmp_path / "states.npz")
    with pytest.raises(gf.InputError, match=r"nope\.npz: cannot be read .*; check the path$"):
        gf.load_packing(tmp_path / "nope.npz")
    with pytest.raises(
        AttributeError, match=r"no attribute 'interval'; did you mean 'intervals'\?"
    ):
        gf.interval  # noqa: B018
    with pytest.raises(TypeError, match=r"^gauss_seidel has no option 'sweeps'; .*rest"):
        gf.gauss_seidel(S, S.original, sweeps=3)


def test_samples_are_drawn_and_intervals_named_as_a_colour():
    S = gf.ensemble(gf.scene("groove"))
    options = {"contacts": S.index, "backend": "matplotlib"}
    for sample in (gf.walk(S, 4), gf.sample_uniform(S, 8)):
        assert gf.plot(S.packing, sample, "spread", **options)
    exact, picture = gf.intervals(S), gf.plot(S.packing, colour="interval", **options)
    (lines,), (others,) = (
        [one for one in drawn.values() if "value" in one] for drawn in (picture, exact.plot(S))
    )
    assert lines.dframe()["value"].tolist() == others.dframe()["value"].tolist()
    with pytest.raises(gf.InputError, match="leave colour out"):
        exact.plot(S, colour="force")
    with pytest.raises(gf.InputError, match=r"^a Volume has no networks to draw"):
        gf.plot(S.packing, gf.volume(S))


def test_results_are_labelled_and_drawn_by_methods():
    S, groove = gf.ensemble(gf.pack(12, 0.3)), gf.ensemble(gf.scene("groove"))
    contact = int(S.index[0])
    draws = gf.infer(S, S.original, 0.1, states=8)
    drawn = [gf.intervals(S), gf.nearest(S, S.original), gf.walk(S, 3), gf.sample_uniform(S, 8)]
    drawn += [gf.reach(S, contact), draws, draws.draws, gf.rest(S), gf.critical_force(S, contact)]
    for result in drawn:
        assert result.plot(S, backend="matplotlib")
        assert result.to_dataset(S).identical(gf.to_dataset(result, S))
        assert result.to_dataframe(S).equals(gf.to_dataframe(result, S))
    assert gf.load_factor(groove, "horizontal").plot(groove, label=None)
    assert S.packing.plot(numbers=True) and S.packing.to_dataframe().size
    assert not hasattr(gf.volume(S), "plot") and not hasattr(S.packing.contacts, "to_dataset")


def test_draws_go_to_arviz():
    S = gf.ensemble(gf.pack(30, 0.3))
    sample = gf.sample_uniform(S, 200)
    tree = gf.to_arviz(sample, S, unit="mean")
    force, checks = tree["posterior"]["force"], tree["sample_stats"]
    assert force.dims == ("chain", "draw", "contact", "component")
    assert checks["residual"].dims == checks["violation"].dims == ("chain", "draw")
    assert np.array_equal(checks["residual"], sample.residual)
    assert np.array_equal(force, sample.states / S.force_scale)
    inferred = gf.infer(S, S.original, 0.1, states=8)
    assert gf.to_arviz(inferred, S)["posterior"].sizes["draw"] == 2
    walk = gf.walk(S, 3)
    assert gf.to_arviz(walk.states[None], S)["posterior"].sizes["draw"] == 3
    for wrong in (walk, gf.infer(S, S.original, 0.1), S.packing):
        with pytest.raises(gf.InputError, match="needs draws by chain"):
            gf.to_arviz(wrong, S)
    with pytest.raises(gf.InputError, match="belongs to another ensemble"):
        gf.to_arviz(gf.sample_uniform(gf.ensemble(S.packing, mu=0.5), 8), S)


@pytest.mark.parametrize(
    "line, said",
    [
        ("pack --friction 0.1", "there is no option --friction; did you mean --mu?"),
        ("critical-load", "command 'critical-load' is unknown; did you mean load-factor --"),
        ("import table bare.csv --mu 0.5", "bare.csv: the first line contains only numbers; "),
        ("import table other.csv --mu 0.5", "other.csv: no column x, y, r; "),
        ("figures rows.csv --out f.png", "rows.csv is a table; "),
        ("plot folder --out f.png", "folder is a folder; plot draws the file of a packing (.npz)"),
        ("plot p.npz --states bounds.zarr --out p.png", "bounds.zarr: contains no states; "),
    ],
)
def test_slips_of_a_newcomer_are_answered_with_what_to_do(line, said, cache, capsys):
    Path("bare.csv").write_text("0,0,1\n2,0,1\n")
    Path("other.csv").write_text("pos_x,pos_y,rad\n0,0,1\n2,0,1\n")
    Path("rows.csv").write_text("mu\n0.1\n")
    Path("folder").mkdir()
    if line.startswith("plot"):
        gf.save_packing(gf.scene("groove"), "p.npz")
        assert main("intervals p.npz --out bounds.zarr".split()) == 0
        capsys.readouterr()
    try:
        code = main(line.split())
    except SystemExit as stop:
        code = stop.code
    told = capsys.readouterr().err
    assert code == 2 and told.count("\n") == 1 and told.startswith(f"granforce: {said}")
    assert "other" not in line or "--columns x=NAME" in told


@pytest.mark.parametrize(
    "option, said",
    [
        ("--mu -1", "must be finite and ≥ 0"),
        ("--ensemble-mu -1", "must be finite and ≥ 0"),
        ("--seed -1", "must be at least 0"),
        ("--walk-seed -1", "must be at least 0"),
        ("-n -1", "must be at least 0"),
        ("--step-accuracy 7", "must be at most 1"),
        ("--drag-below 7", "must be at most 1"),
        ("--box-mass 1e99", "must lie between 1e-60 and 1e+60"),
        ("--states 0", "must be at least 1"),
        ("--chains 0", "must be at least 1"),
    ],
)
def test_messages_name_the_option_that_was_typed(option, said, cache, capsys):
    usual = " --mu 0.3" if "--mu" not in option.split() else ""
    assert main(f"walk {option}{usual}".split()) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"granforce: {option.split()[0]} {said}")


def test_only_disks_without_support_are_named():
    floor = [[0, 0, 12, 0]]
    with pytest.raises(gf.NotJammedError, match=r"at grains 1 \(counted from 0\)"):
        gf.from_disks([(1, 0.3), (4, 1)], [0.3, 0.3], 0.3, walls=floor, gravity=1)


def test_a_load_factor_of_rounding_errors_is_0(monkeypatch):
    S, solve = gf.ensemble(gf.scene("press")), grain_loads.most_under
    monkeypatch.setattr(grain_loads, "most_under", lambda system: (-2.5e-32, *solve(system)[1:]))
    assert gf.load_factor(S).factor == 0.0


def test_bars_end_at_their_total_unless_interrupted(capsys, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    with terminal.Bar("bounds", "bound") as progress:
        progress(3, 8)
    assert "8/8" in capsys.readouterr().err.rsplit("\r", 1)[-1]
    with suppress(KeyboardInterrupt), terminal.Bar("bounds", "bound") as progress:
        progress(3, 8)
        raise KeyboardInterrupt
    assert "3/8" in capsys.readouterr().err.rsplit("\r", 1)[-1]


def test_friction_0_is_named_where_a_logarithmic_axis_has_no_place_for_it():
    rows = [{"mu": mu, "coordination": 4 - mu, "eta1": 0.1} for mu in (0.0, 0.1, 1.0)]
    titles = [title(frame) for frame in gf.figures.indeterminacy(rows, backend="matplotlib")]
    assert any(name.startswith("Coordination; z = 4 at") for name in titles)


def test_the_list_of_the_store_names_packings_in_words(cache, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    gf.save_packing(gf.scene("groove"), "p.npz")
    assert main("intervals p.npz".split()) == main("walk -n 12 --mu 0.3 --states 4".split()) == 0
    capsys.readouterr()
    assert main(["cache", "list"]) == 0
    told = capsys.readouterr().out
    assert max(map(len, told.splitlines())) <= 80
    assert "  12 disks, μ = 0.3, seed 1" in told and "  imported " in told


@pytest.mark.parametrize("backend", ["bokeh", "matplotlib"])
def test_pictures_show_the_numbers_of_contacts(backend):
    packing = gf.scene("groove")
    kinds = {"numbers": True, "backend": backend}
    (labels,) = gf.plot(packing, **kinds).traverse(lambda x: x, [hv.Labels])
    assert labels.dimension_values(2).tolist() == ["0", "1"]
    assert labels.array([0, 1]).astype(float) == pytest.approx(packing.contact_points)
    assert not gf.plot(packing, backend=backend).traverse(lambda x: x, [hv.Labels])
    assert hv.render(gf.plot(packing, **kinds), backend=backend)


def test_results_on_all_contacts_are_labelled(pile):
    S = gf.ensemble(pile)
    for result in (gf.load_factor(S), gf.critical_load(S), gf.rest(S)):
        table = gf.to_dataframe(result, S)
        assert table["f_n [packing]"].tolist() == result.forces[:, 0].tolist()
        assert table["j"].tolist() == pile.contacts.j.tolist()
    low = gf.to_dataset(gf.intervals(S), S)["low"]
    assert low.long_name == VARIABLES["low"].long_name


def test_a_photoelastic_frame_is_answered_with_its_packing():
    frame = gf.synthetic_frame(packed(30, 0.5), noise=0.05, seed=1)
    photo = gf.read_pegs(frame, mu=0.5)
    with pytest.raises(gf.InputError, match=r"gf\.ensemble\(photo\.packing\)"):
        gf.infer(photo, photo.measured, photo.sigma)


def test_a_load_without_limit_keeps_its_load_factor(cache, capsys):
    assert main("pack --scene ladder --mu 0.6 --out ladder.npz".split()) == 0
    capsys.readouterr()
    assert main("load-factor ladder.npz --load horizontal --critical".split()) == 0
    told = capsys.readouterr()
    assert re.search(r"^load factor +inf$", told.out, re.M) and "critical" not in told.out
    assert told.err.startswith("granforce: contact forces can balance every multiple of this load")
    with pytest.raises(gf.InputError, match="every multiple of this load"):
        gf.critical_load(gf.ensemble(gf.load_packing("ladder.npz")))


def test_contacts_that_pull_are_named_where_nothing_balances():
    box = "ITEM: BOX BOUNDS ff ff pp\n" + 3 * "-5 5\n"
    head = "ITEM: TIMESTEP\n1\nITEM: NUMBER OF {}\n3\n" + box + "ITEM: {}\n"
    disks = "1 0 0 1\n2 1.98 0 1\n3 0.99 1.71473 1\n"
    pairs = "1 2 1.98 1 0 0 0\n1 3 1.98 -0.5 -0.866025 0 0\n2 3 1.98 0.5 -0.866025 0 0\n"
    particles = head.format("ATOMS", "ATOMS id x y radius") + disks
    contacts = head.format("ENTRIES", "ENTRIES atom1 atom2 distance fx fy px py") + pairs
    packing = gf.read_lammps(io.StringIO(particles), io.StringIO(contacts), mu=0.5)
    with pytest.raises(gf.NotJammedError, match="forces pull on contact 0, and contacts can only"):
        gf.ensemble(packing)


def square_lattice(f_n, across, up):
    """Files of 3 × 3 disks of radius 1/2 in rows and columns, and of their contacts.

    f_t is `across` on horizontal and `up` on vertical contacts.
    """
    grains, contacts = "x,y,r\n", "i,j,f_n,f_t\n"
    for k in range(9):
        a, b = k % 3, k // 3
        grains += f"{a},{b},0.5\n"
        contacts += f"{k},{3 * b + (a + 1) % 3},{f_n},{across}\n"
        contacts += f"{k},{3 * ((b + 1) % 3) + a},{f_n},{up}\n"
    return io.StringIO(grains), io.StringIO(contacts)


def test_forces_that_are_clearly_no_equilibrium_are_noted():
    """A sheared lattice balances if |f_t| has opposite signs; of equal sign they turn each disk."""
    good = gf.read_table(*square_lattice(1, 0.25, -0.25), mu=0.3, box=[3, 3])
    assert good.info["residual"] < 1e-14 and "notes" not in good.info
    with pytest.warns(gf.InputWarning) as warned:
        slipped = gf.read_table(*square_lattice(1, 0.5, -0.5), mu=0.3, box=[3, 3])
    (note,) = slipped.info["notes"]
    assert [str(one.message) for one in warned] == [note] and warned[0].filename == __file__
    assert "|f_t| ≤ μ f_n by up to 0.2 ⟨f_n⟩: check μ = 0.3" in note  # 0.5 − 0.3
    with pytest.warns(gf.InputWarning, match="by up to 1"):
        turned = gf.read_table(*square_lattice(1, 0.25, 0.25), mu=0.3, box=[3, 3])
    (note,) = turned.info["notes"]
    assert "do not balance the grains, by up to 1 ⟨f_n⟩" in note  # four contacts


def test_the_command_prints_such_a_note(cache, capsys):
    for name, file in zip(("g.csv", "c.csv"), square_lattice(1, 0.5, -0.5), strict=True):
        Path(name).write_text(file.read())
    assert main("import table g.csv c.csv --mu 0.3 --box 3 3".split()) == 0
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("granforce: the forces violate f_n ≥ 0 or |f_t| ≤ μ f_n")


def test_a_periodic_table_with_few_digits_is_answered_with_the_tolerance():
    """The box is larger by 10⁻⁴, so that 3 rows of contacts lack 3 and 3 columns lack 1 each."""
    rows = "".join(f"{k % 3 * 1.0001},{k // 3},0.5\n" for k in range(9))
    options = {"mu": 0.3, "box": [3.0003, 3.0001]}
    with pytest.raises(gf.NotJammedError, match=r"12 pairs nearly touch, .* 0\.0002 .*--tolerance"):
        gf.read_table(io.StringIO("x,y,r\n" + rows), **options)
    contacts = io.StringIO("i,j\n0,3\n3,6\n1,4\n4,7\n2,5\n5,8\n")
    with pytest.raises(gf.NotJammedError, match=r"12 pairs nearly touch.* not listed as contacts$"):
        gf.read_table(io.StringIO("x,y,r\n" + rows), contacts, **options)


def test_a_contact_just_inside_the_tolerance_is_in_doubt_too():
    row = [[1, 1], [3, 1], [5 + 9e-7, 1]]
    options = {"mu": 0.6, "walls": "floor", "gravity": 1}
    packing = gf.from_disks(row, [1, 1, 1], **options)
    (note,) = packing.info["notes"]
    assert "1 contact is in doubt: gaps up to 9e-07 of the largest radius" in note
    assert "tolerance 1e-06" in note and "leaves out grains 1 and 2 (counted from 0)" in note
    ((i, j, gap),) = packing.info["nearly_touching"]
    assert (i, j) == (1, 2) and gap == pytest.approx(9e-7, rel=1e-6)
    without = gf.from_disks(row, [1, 1, 1], tolerance=1e-7, **options)
    assert len(without.contacts.i) == len(packing.contacts.i) - 1
    assert without.info["nearly_touching"] == packing.info["nearly_touching"]
    even = [[1, 1], [3 + 9e-7, 1], [5 + 18e-7, 1]]  # all have few digits: none stands out
    assert "notes" not in gf.from_disks(even, [1, 1, 1], **options).info


def test_an_export_to_lammps_says_that_walls_become_grains(cache):
    gf.save_packing(gf.scene("groove", 0.3), "groove.npz")
    with pytest.warns(UserWarning, match="^2 walls or other grains whose balance is not"):
        assert main("export groove.npz grains.dump contacts.dump".split()) == 0
    gf.save_packing(packed(30, 0.3), "p.npz")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert main("export groove.npz grains.vtp contacts.vtp".split()) == 0
        assert main("export p.npz grains.dump contacts.dump".split()) == 0


@pytest.mark.parametrize("row", [",,", "", " , , "])
def test_empty_rows_between_others_are_refused_with_their_line(row):
    options = {"mu": 0.6, "walls": "floor", "gravity": 1}
    rows = "x,y,r\n1,1,1\n{}3,1,1\n"
    with pytest.raises(gf.InputError, match=r", line 3: an empty row; fill or remove it"):
        gf.read_table(io.StringIO(rows.format(row + "\n")), **options)
    assert len(gf.read_table(io.StringIO(rows.format("") + row + "\n"), **options).r) == 4


def test_the_default_error_of_a_frame_makes_chi_square_its_degrees_of_freedom():
    """Each contact is measured on both disks with errors of 0.1, the mean with 0.1/√2."""
    frames = [gf.synthetic_frame(packed(40, 0.5, 2), noise=0.1, seed=seed) for seed in range(10)]
    reports = [gf.read_pegs(frame, mu=0.5).report for frame in frames]
    ratio = [report["chi_square"] / report["freedom"] for report in reports]
    assert np.mean(ratio) == pytest.approx(1, abs=0.02)
    assert np.mean([report["error"] for report in reports]) == pytest.approx(0.0707, rel=0.06)


def test_figure_1_takes_a_pandas_table():
    rows = [{"mu": mu, "coordination": 4.0, "eta1": 0.1, "eta2": 0.1} for mu in (0.1, 1.0)]
    assert gf.figures.indeterminacy(pd.DataFrame(rows)) is not None


def test_datasets_are_written_to_zarr_without_warnings(tmp_path):
    S = gf.ensemble(gf.scene("groove", 0.3))
    dataset = gf.to_dataset(gf.intervals(S), S)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        dataset.to_zarr(tmp_path / "s.zarr", consolidated=False)
    read = xr.open_zarr(tmp_path / "s.zarr", consolidated=False)
    assert read.identical(dataset) and read["low"].sel(component="f_t").shape == (2,)


def test_a_table_where_an_archive_is_meant_is_answered_with_the_import(cache, capsys):
    Path("pile.csv").write_text("x,y,r\n1,1,1\n")
    assert main("intervals pile.csv".split()) == 2
    assert "granforce import" in capsys.readouterr().err


PYRAMID = f"x,y,r\n1,1,1\n3,1,1\n2,{1 + 3**0.5},1\n"  # stands from μ = tan 15° = 0.268


def test_a_smooth_contact_in_a_conflict_is_named_as_such():
    pyramid = gf.read_table(io.StringIO(PYRAMID), mu=0.3, walls="floor", gravity=1)
    mu = np.where(pyramid.contacts.j < 3, 0.3, 0.0)  # a smooth floor
    with pytest.raises(
        gf.NotJammedError, match=r"f_t = 0 where μ is 0; these conflict: f_t = 0 on"
    ):
        gf.ensemble(pyramid, mu)


def test_a_conflict_names_frictionless_contacts_only_where_there_are_some():
    S = gf.ensemble(packed(30, 0.3, 1))
    known = gf.Known([0], 1e3, 1e3)
    with pytest.raises(gf.NotJammedError, match=r"all known forces; these conflict: f_n = 1000"):
        gf.ensemble(S.packing, known=known)


def test_centres_and_radii_in_different_units_are_suspected():
    grains = "x,y,r\n" + "\n".join(f"{1000 * k},{1000 * (k % 3 + 1)},1" for k in range(9))
    for walls in ("floor", "box"):
        with pytest.raises(gf.NotJammedError, match=r"only 0 of 9 grains touch another: .* unit"):
            gf.read_table(io.StringIO(grains), mu=0.3, walls=walls, gravity=1)


def test_pairs_far_apart_are_not_in_doubt_at_a_large_tolerance():
    grains = "x,y,r\n1,1,1\n3.02,1,1\n5.5,1,1\n"  # gaps 0.02 and 0.48
    for tolerance, doubted in ((0.05, 0), (0.4, 0), (0.0005, 1)):
        packing = gf.read_table(
            io.StringIO(grains), mu=0.3, walls="floor", gravity=1, tolerance=tolerance
        )
        assert len(packing.info["nearly_touching"]) == doubted


def test_a_floor_without_side_walls_is_said():
    with pytest.raises(gf.NotJammedError, match=r"only one wall is given: .*--walls box"):
        gf.read_table(io.StringIO(PYRAMID), mu=0.1, walls="floor", gravity=1)


def test_building_the_documentation_is_said_at_once(tmp_path, monkeypatch, capsys):
    def run(*arguments, **options):
        assert "building the documentation" in capsys.readouterr().err
        return subprocess.CompletedProcess(arguments, 0)

    monkeypatch.setattr(subprocess, "run", run)
    assert main(["docs", "--out", str(tmp_path / "site")]) == 0


@pytest.mark.filterwarnings("ignore:.*whose balance is not required")
def test_notes_on_snapshots_name_all_of_them(cache, capsys):
    pyramid = gf.read_table(io.StringIO(PYRAMID), mu=0.3, walls="floor", gravity=1)
    gf.save_lammps(pyramid, "g.dump", "c.dump")
    for name in ("g.dump", "c.dump"):
        once = Path(name).read_text()
        steps = [once.replace("TIMESTEP\n0", f"TIMESTEP\n{step}") for step in (100, 200)]
        Path(name).write_text("".join(steps))
    words = "import lammps g.dump c.dump --mu 0.3 --frames all --states 0 --workers 1"
    assert main(words.split()) == 0
    told = capsys.readouterr().err
    assert told.count("contacts do not balance") == 1
    assert "granforce: timestep 100, 200: contacts do not balance 5 of 5 grains" in told
