"""What the READMEs tell to run runs, and what they name is there."""

import contextlib
import importlib.util
import io
import json
import re
import shlex
import shutil
import tomllib
from pathlib import Path

import frames
import numpy as np
import pytest
import simulators
import yaml
from packings import packed

import granforce
from granforce.bench import PARTS, solvers
from granforce.bench import documents as benchmarks
from granforce.cli.entry_point import main
from granforce.cli.parser import make_parser
from granforce.paper import csv_tables, documents, highlights, tables
from granforce.paper.claims.table import CLAIMS
from granforce.paper.claims.verdicts import verdict_of
from granforce.system import markdown

ROOT = Path(__file__).parents[1]
PAGES = sorted(
    str(path.relative_to(ROOT)) for path in (ROOT / "granforce/docs/pages").rglob("*.md")
)
DOCUMENTS = ["README.md", "granforce/README.md", "data/README.md", "app/README.md", *PAGES]
GUIDES = [".github/CONTRIBUTING.md", "tests/README.md", "CHANGELOG.md"]  # commands in parts
RESULTS = [
    "README.md",
    "granforce/docs/pages/results.md",
    "granforce/docs/pages/results-in-detail.md",
]
LAMMPS = ROOT / "tests" / "lammps" / "lammps_n400_mu0.3"

# The same at a size that takes no time: texts of commands and snippets, and what replaces them.
SMALL = {
    r"(?<=-n )400|(?<=pack\()400": "30",
    r"(?<=--states )\d+|(?<=states=)\d+": "8",
    r"(?<=--keep )\d+": "5",
    r"(?<=n=12, )": "workers=1, ",
    r"(?<=--random )\d+": "1",
    r"(?<=--mu )[\d.]+,[\d.,]+": "0,0.3",
}
# Commands that take minutes, or stay: they are parsed only.
LONG = ("study", "bench", "app")


def text(document):
    return (ROOT / document).read_text()


def blocks(document):
    """(language, code) of every fenced block."""
    return re.findall(r"^```(\w*)\n(.*?)^```$", text(document), re.M | re.S)


def small(code):
    for pattern, less in SMALL.items():
        code = re.sub(pattern, less, code)
    return code


def known():
    """The command line's own list of its commands."""
    (subparsers,) = (a for a in make_parser()._actions if hasattr(a, "choices") and a.choices)
    return set(subparsers.choices)


def commands(document):
    """Words of every `granforce …` in the text and in blocks."""
    lines = [line for _, code in blocks(document) for line in code.replace("\\\n", " ").split("\n")]
    quoted = re.findall(
        r"`(granforce [^`\n]+)`", re.sub(r"^```.*?^```$", "", text(document), flags=re.M | re.S)
    )
    found = []
    for line in [*lines, *quoted]:
        alone = line.partition("&&")[0]
        words = shlex.split(alone, comments=True) if "granforce " in line else []
        while words and "=" in words[0]:
            words.pop(0)  # variables
        if "--help" not in words and words[:1] == ["granforce"] and "".join(words[1:2]).islower():
            found.append(words[1:])
    return found


@pytest.fixture
def folder(away):
    """A folder with the files that the commands name, and a store of its own."""
    for name in ("particles", "contacts"):
        shutil.copy(f"{LAMMPS}.{name}.dump", away / f"{name}.dump")
    packing = packed(30, 0.3)
    rows = np.column_stack([packing.x, packing.r])
    size = 30 / packing.box[0]  # the box that the command names
    np.savetxt("grains.csv", size * rows, delimiter=",", header="x,y,r", comments="")
    pairs = np.column_stack([packing.contacts.i, packing.contacts.j])
    np.savetxt("contacts.csv", pairs, fmt="%d", delimiter=",", header="i,j", comments="")
    yade, mercury = (made(scale=size) for made in (simulators.yade, simulators.mercury))
    names = "bodies.txt", "interactions.txt", "run.data", "run.fstat"
    for name, content in zip(names, (*yade, *mercury), strict=True):
        Path(name).write_bytes(content)
    corners = "g,-1,-1,1\ng,2,-1,1\ng,2,0,1\ng,-1,0,1\nb,0,0,0\nb,1,0,0\nb,1,1,0\nb,0,1,0\n"
    Path("bodies.csv").write_text(f"body,x,y,fixed\n{corners}")
    Path("pile.csv").write_text("x,y,r\n1,1,1\n3,1,1\n2,2.7320508,1\n")
    grains, rows, _ = frames.frame(60, missing=0.1, noise=0.1)
    frames.write(away, grains, rows)
    (away / "data").mkdir()
    return away


def test_all_documents_name_one_version():
    """The newest release of the changelog is the version, and its date that of CITATION.cff."""
    (heading, *_) = re.findall(r"^## (\d.+)$", text("CHANGELOG.md"), re.M)
    version, _, date = heading.partition(" — ")
    citation = yaml.safe_load(text("CITATION.cff"))
    assert version == granforce.__version__ == citation["version"]
    assert date == f"{citation['date-released']:%-d %B %Y}"
    assert f"version = {{{version}}}" in text("granforce/docs/pages/howto/cite.md")


def test_the_conda_recipe_has_the_version_and_the_requirements_of_the_wheel():
    recipe = yaml.safe_load(text(".github/recipe/recipe.yaml"))
    assert recipe["context"]["version"] == granforce.__version__
    project = tomllib.loads(text("pyproject.toml"))["project"]
    wanted = [re.sub(r"(?=[><])", " ", one, count=1) for one in project["dependencies"]]
    wanted = [one.replace("matplotlib ", "matplotlib-base ") for one in wanted]
    python = f"python {project['requires-python']}"
    assert recipe["requirements"]["run"] == [python, *wanted]
    assert recipe["build"]["python"]["entry_points"] == [
        f"{name} = {target}" for name, target in project["scripts"].items()
    ]


def test_the_readme_is_short_and_gives_the_commands_that_install():
    lines = text("README.md").splitlines()
    assert len(lines) <= 90
    for ends in ("panel serve app --show", "-m pytest"):
        assert any(
            line.startswith("python3 -m venv .venv") and line.endswith(ends) for line in lines
        )


def test_the_text_of_the_wheel_names_nothing_outside_it():
    described = tomllib.loads(text("pyproject.toml"))["project"]["readme"]["text"]
    links = re.findall(r"\]\(([^)]+)\)", described)
    assert links and all(link.startswith("https://") for link in links)
    named = set(re.findall(r"`granforce (\w+)`", described))
    assert named == {"app", "docs"} and named <= known()
    assert not [word for word in re.findall(r"[\w/]+\.\w+", described) if (ROOT / word).exists()]


@pytest.mark.parametrize("document", DOCUMENTS)
def test_every_command_is_understood(document):
    for words in commands(document):
        if words[1:]:
            make_parser().parse_args(words)
        else:
            assert words[0] in known()


@pytest.mark.parametrize("document", [*DOCUMENTS[:3], *PAGES])
def test_every_short_command_runs(document, folder, capsys):
    ran = 0
    for words in commands(document):
        if words[0] in LONG or not words[1:]:
            continue
        words = shlex.split(small(shlex.join(words)))
        if words[0] == "scan" or "--frames" in words:
            words += ["--workers", "1"]  # no process
        assert main(words) == 0, (words, capsys.readouterr().err)
        ran += 1
    assert ran or document not in DOCUMENTS[:1]


def printed_by(code):
    """What a snippet prints, as a script."""
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        exec(code, {"__name__": "__main__"})
    return printed.getvalue()


@pytest.mark.parametrize("document", [name for name in DOCUMENTS if "gallery" not in name])
def test_every_snippet_runs(document, folder):
    for language, code in blocks(document):
        if language == "python":
            assert printed_by(small(code))
        else:
            assert language in ("", "sh", "text")


def outputs(document):
    """(code, output) of every snippet followed by what it prints."""
    pattern = r"^```python\n(.*?)^```\n\n```text\n(.*?)^```$"
    return re.findall(pattern, text(document), re.M | re.S)


TUTORIAL = "granforce/docs/pages/tutorial.md"
OUTPUTS = [
    pytest.param(*both, marks=pytest.mark.slow if "400" in both[0] else ())
    for document in ("README.md", "granforce/docs/pages/index.md", TUTORIAL)
    for both in outputs(document)
]


@pytest.mark.parametrize(("code", "shown"), OUTPUTS)
def test_documents_show_what_their_snippets_print(code, shown, away):
    """Words are equal, and numbers within 2 %: packings differ between processors."""
    printed, expected = printed_by(code).split(), shown.split()
    assert len(printed) == len(expected)
    for word, other in zip(printed, expected, strict=True):
        try:
            assert float(word) == pytest.approx(float(other), rel=0.02)
        except ValueError:
            assert word == other


def test_each_step_of_the_tutorial_has_its_output():
    snippets = [code for name, code in blocks(TUTORIAL) if name == "python"]
    assert [code for code, _ in outputs(TUTORIAL)] == snippets


@pytest.mark.parametrize("document", [*DOCUMENTS, *GUIDES])
def test_every_link_leads_somewhere(document):
    for target in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", text(document)):
        if "://" not in target and not target.startswith("reference/"):  # made with the site
            assert (ROOT / document).parent.joinpath(target).exists(), target


@pytest.mark.parametrize("document", [*DOCUMENTS, GUIDES[0]])
def test_every_file_named_is_there(document):
    for name in re.findall(r"`((?:app|granforce|tests)/[\w/.]+)`", text(document)):
        assert (ROOT / name).exists(), name


@pytest.mark.parametrize("document", DOCUMENTS)
def test_every_module_to_run_is_there(document):
    for name in re.findall(r"python -m (granforce[\w.]*)", text(document)):
        assert importlib.util.find_spec(name) is not None, name


@pytest.fixture(scope="module")
def study():
    """The table that is shipped, and what is told of it."""
    told = json.loads(text("data/claims.json").replace("null", "NaN"))
    return tables.load(ROOT / "data/study.zarr"), told


@pytest.mark.parametrize("document", RESULTS)
def test_what_the_study_tells_is_what_is_shipped(document, study, tmp_path):
    """Everything between marks is what the shipped study gives: no number was typed."""
    table, told = study
    copied = tmp_path / "copy.md"
    shutil.copy(ROOT / document, copied)
    documents.renew([copied], table, told["claims"], told["findings"])
    assert copied.read_text() == text(document)


def test_the_tables_are_those_of_the_shipped_study(study, tmp_path):
    table, told = study
    csv_tables.save(tmp_path, table, told["claims"], told["findings"])
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {path.name for path in (ROOT / "data/tables").iterdir()}
    for name in names:
        assert (tmp_path / name).read_text() == text(f"data/tables/{name}"), name


def changed(told, id, span="", **numbers):
    """The claims and findings with other numbers for one finding, or by exact intervals."""
    findings = [
        row | numbers if (row["id"], row["span"]) == (id, span) else row for row in told["findings"]
    ]
    exact = {"by": {"exact": numbers}}
    return [row | exact if row["id"] == id else row for row in told["claims"]], findings


@pytest.mark.parametrize(
    ("id", "span", "numbers", "told_then"),
    [
        ("turns", "", {"verdict": "undecided"}, "^Whether the exact intervals"),
        ("exact-peak", "", {"high": 4.0}, "longest at one friction coefficient"),
        ("extent-correlation", "intermediate", {"low": -0.1}, "Whether strong contacts"),
        ("relative-correlation", "intermediate", {"high": 0.1}, "whether they are shorter"),
        ("exact-size-0.1", "", {"low": -0.1}, "too few to tell whether exact η3"),
        ("part-of-load", "intermediate", {"high": 1.1}, None),
        ("exact-peak", "", {"high": np.nan}, None),
        ("exact-slope-1e-05", "", {"low": 1.1}, None),
    ],
)
def test_findings_say_no_more_than_their_numbers(study, id, span, numbers, told_then):
    table, told = study
    before = highlights.highlights(table, told["claims"], told["findings"])
    after = highlights.highlights(table, *changed(told, id, span, **numbers))
    if told_then is None:
        assert len(after) == len(before) - 1
    else:
        assert any(re.search(told_then, one.sentence) for one in after)
        assert not any(re.search(told_then, one.sentence) for one in before)


def test_the_claims_are_those_of_the_shipped_study(study):
    table, told = study
    known = {claim["id"]: claim for claim in told["claims"]}
    assert known.keys() == {claim.id for claim in CLAIMS}
    for claim in CLAIMS:
        if claim.id in ("factors", "linear", "coordination"):
            sampler = known[claim.id]["sampler"]
            now = verdict_of(list(claim.measure(table, sampler)), claim.ranges)
            shipped = known[claim.id]["by"][sampler]
            assert now["verdict"] == shipped["verdict"]
            values = [case["value"] for case in shipped["cases"]]
            assert [case["value"] for case in now["cases"]] == pytest.approx(values, rel=1e-6)


def test_the_page_on_accuracy_is_what_the_shipped_benchmark_gives(tmp_path):
    page, copied = text("granforce/docs/pages/accuracy.md"), tmp_path / "copy.md"
    copied.write_text(markdown.mark(benchmarks.KIND).sub(r"\1\3", page))
    line = ["bench", "--table", str(ROOT / "data/bench.json"), "--documents", str(copied)]
    assert main(line) == 0
    assert copied.read_text() == page and page.count("\n| ---") >= 4


def test_the_shipped_benchmark_is_of_the_present_solvers():
    """No row of a former run is left: solvers have the names of now, and no part is empty."""
    results = json.loads(text("data/bench.json"))
    for row in results["relaxation"]:
        assert row["solver"] in solvers.solvers()
    assert {"environment", "quick", "seconds", *results["seconds"]} == set(results)
    assert set(results["seconds"]) <= set(PARTS)
    assert "Not measured" not in text("granforce/docs/pages/accuracy.md")


def test_the_summary_of_the_benchmark_has_its_least_and_largest_ratio(tmp_path):
    path = tmp_path / "page.md"
    path.write_text("<!-- bench: summary -->\n<!-- end -->\n")
    rows = [
        {"solver": solver, "ratio": ratio, "worst_residual": residual}
        for solver, ratio, residual in (
            ("Gauss–Seidel alone", 1.0, 1.0),
            ("nearest", 0.5, 1e-12),
            ("nearest", 30.0, 2e-12),
        )
    ]
    benchmarks.renew([path], {"environment": {"libraries": {}}, "relaxation": rows})
    (line,) = path.read_text().splitlines()[3:-1]
    assert line == "| nearest network | Gauss–Seidel sweeps | 0.5 to 30 | 2·10⁻¹² |"


def test_the_cost_table_joins_packings_and_solvers_by_size(tmp_path):
    path = tmp_path / "page.md"
    path.write_text("<!-- bench: cost -->\n<!-- end -->\n")
    rows = [{"n": 100, "bound": 1.0}, {"n": 400, "bound": 2.0}, {"n": "exponent", "bound": 0.5}]
    packings = [{"n": 400, "seconds": 3.0}, {"n": "fit", "exponent": 1.5}]
    benchmarks.renew([path], {"growth": rows, "compaction_growth": packings})
    lines = path.read_text().splitlines()[1:-1]
    assert lines[0] == "| n | packing / s | one of 32 bounds / s |"
    assert lines[2:] == ["| 100 |  | 1 |", "| 400 | 3 | 2 |", "| exponent | 1.5 | 0.5 |"]


@pytest.mark.parametrize("document", RESULTS)
def test_results_have_no_typed_numbers(document):
    """Outside of generated parts no measured number is given: none with a ± or an interval."""
    typed = markdown.mark(documents.KIND).sub("", text(document))
    assert not re.findall(r"\d\S* ±|\d\(\d|\d+\.\d+ \(|\b(?!95)\d+ %|\d+\.\d+ …", typed)


def test_the_map_shows_every_room():
    (layout,) = (code for _, code in blocks("granforce/README.md") if code.startswith("cli/"))
    rooms, room = {}, ""
    for line in layout.splitlines():
        name = line.split(" ")[0]
        room = name if name.endswith("/") else room if not name else ""
        rooms.setdefault(room, []).extend(re.findall(r"[\w/]+(?:\.py|/)(?=\W|$)", line))
    folders = {f"{path.parent.name}/" for path in (ROOT / "granforce").glob("*/*.py")}
    assert set(rooms) - {""} == folders
    for room, names in rooms.items():
        for name in names:
            assert (ROOT / "granforce" / room / name.removeprefix(room)).exists(), (room, name)
    beside = {path.name for path in (ROOT / "granforce").glob("*.py")} - {
        "__init__.py",
        "__main__.py",
    }
    assert set(rooms[""]) == beside
