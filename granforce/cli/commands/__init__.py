"""The commands, by subject: each takes its arguments and may return an exit code."""

from granforce.cli.commands.exact import intervals, limit_loads, load_factor, perturb, rest, stress
from granforce.cli.commands.inference import infer, informative
from granforce.cli.commands.packings import export, import_, pack
from granforce.cli.commands.pictures import figures, plot
from granforce.cli.commands.service import app, bench, cache, completion, docs, study_
from granforce.cli.commands.states import measure, scan, uniform, volume, walk

__all__ = [
    "app",
    "bench",
    "cache",
    "completion",
    "docs",
    "export",
    "figures",
    "import_",
    "infer",
    "informative",
    "intervals",
    "limit_loads",
    "load_factor",
    "measure",
    "pack",
    "perturb",
    "plot",
    "rest",
    "scan",
    "stress",
    "study_",
    "uniform",
    "volume",
    "walk",
]
