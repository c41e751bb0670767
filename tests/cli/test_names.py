"""A name means one thing in the store, in records and in reports, which are made from the store."""

import importlib
import inspect
import pkgutil
from argparse import Namespace

import pytest

import granforce
from granforce.cli.command_table import COMMANDS, FORMATS
from granforce.cli.report_lines import line
from granforce.cli.results import StoredResult
from granforce.explore.random_walk import RELAXATIONS
from granforce.fields import fields
from granforce.quantities import QUANTITIES
from granforce.study.evolution import SCALARS
from granforce.study.relaxations import STORED, as_stored, from_stored
from granforce.study.responses import unsteady
from granforce.study.schema import labelled

pytestmark = pytest.mark.fast

# Fields of records with the name of a stored quantity that they are not, by what they belong to.
OF_THE_RECORD = {
    "forces": {"Inference", "Remeasured", "Rest", "CriticalForce", "LoadFactor", "CriticalLoad"}
    | {"Relaxation"},  # its network
    "states": {"Reach", "Loaded"},
    "gap": {"Intervals", "LimitLoads", "Outline", "Reach"},  # of its bounds; else of a contact
    "low": {"Reach"},  # over S; else over states
    "high": {"Reach"},
    "residual": {"CriticalForce"},  # under its load
    "violation": {"CriticalForce"},
    "load": {"Loaded"},
    "axes": {"Body"},  # all of S; else a plane
    "corners": {"Body", "Outline"},  # of a polygon in S; else of a grain
    "opened": {"Pull", "Reach", "Response"},  # which contacts; else how many
    "slid": {"Response"},
    "kept": {"Response"},
}


def records():
    """All records of the library with declared fields."""
    for module in pkgutil.walk_packages(granforce.__path__, "granforce."):
        if module.name.endswith(("__main__", "siconos_nsgs")) or ".docs" in module.name:
            continue
        for one in vars(importlib.import_module(module.name)).values():
            if inspect.isclass(one) and one.__module__ == module.name and hasattr(one, "_fields"):
                yield one


def test_lines_of_reports_with_the_name_of_a_stored_quantity_give_it():
    commands = (*COMMANDS, *FORMATS)
    names = {name for command in commands for name in (*command.lines, *command.columns)}
    others = {name for name in names & QUANTITIES.keys() if line(name).stored != name}
    assert others == {"reached"}  # left out of a report if nothing was requested
    assert len(names & QUANTITIES.keys()) > 30
    assert all(line(name).stored in {"", *QUANTITIES} for name in names)


def test_fields_of_records_with_the_name_of_a_stored_quantity_are_it():
    other = {}
    for record in records():
        for name, field in fields(record).items():
            label = name if field.label is None else field.label
            if label in QUANTITIES and field.meaning != QUANTITIES[label].meaning:
                other.setdefault(label, set()).add(record.__name__)
    assert other == OF_THE_RECORD


def test_numbers_of_snapshots_mean_what_the_store_says():
    same = SCALARS.keys() & QUANTITIES.keys()
    assert {name for name in same if SCALARS[name]["long_name"] != QUANTITIES[name].meaning} == {
        "residual"
    }


def test_relaxations_have_one_name_where_people_read_them():
    assert STORED.keys() == RELAXATIONS.keys()
    for name, stored in STORED.items():
        assert as_stored({"relax": name}) == {"relax": stored}
        assert from_stored({"relax": stored}) == {"relax": name}


def test_directions_taken_as_pinned_are_reported_where_there_are_any():
    names = ("dimension", "directions_taken_as_pinned", "as_narrower_than", "cached")
    for flat, expected in ((0, [4, True]), (2, [4, 2, 1e-9, True])):
        extent = {"dimension": 4, "flat_directions": flat, "resolution": 1e-9}
        result = StoredResult("walk-0", {}, labelled(extent), cached=True)
        lines = result.report(names, Namespace(json=False, unit="packing"))
        assert list(lines.values()) == expected


def test_contacts_without_steady_motion_are_named():
    loads = {"critical_high": [1, 1, 2], "limit_load": [2, 2, 2], "motion_breach": [0, 1, 1]}
    dataset = labelled({"backbone": [3, 5, 8], **loads})
    assert unsteady(dataset).startswith("contact 5: the motion under the smallest load")
    assert unsteady(dataset.isel(contact=[0, 2])) == ""  # the last one reached its limit load
