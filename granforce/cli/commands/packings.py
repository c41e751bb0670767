"""Packings: made, or from elsewhere."""

import argparse
from typing import Any

import numpy as np

from granforce.cli.asked import (
    check_outputs,
    get_packing,
    packing_parameters,
    required_mu,
    write_csv,
)
from granforce.packing import importers, scenes
from granforce.records import InputError, whole
from granforce.study.store import open_store
from granforce.system.terminal import print_report


def pack(arguments: argparse.Namespace) -> None:
    """Make or find a packing, or a scene; report it."""
    if arguments.scene is not None:
        return _scene(arguments)
    parameters = packing_parameters(arguments, required_mu(arguments), arguments.seed)
    max_steps = whole(arguments.max_steps, "--max-steps", 1)
    check_outputs(arguments.out)
    store = open_store(arguments.cache)
    packing, cached = get_packing(store, parameters, max_steps=max_steps)
    if arguments.out is not None:
        importers.save_packing(packing, arguments.out)
    told = "steps", "sweeps_done", "unfinished_steps", "largest_contact_gap", "least_other_gap"
    work = {name: packing.info[name] for name in told}
    lines = {**importers.report(packing), **work, "cached": cached}
    print_report(lines, arguments.json)


def _scene(arguments: argparse.Namespace) -> None:
    check_outputs(arguments.out)
    packing = scenes.scene(arguments.scene, arguments.mu)
    if arguments.out is not None:
        importers.save_packing(packing, arguments.out)
    print_report({"scene": arguments.scene, **importers.report(packing)}, arguments.json)


def import_(arguments: argparse.Namespace) -> None:
    """Read a packing from elsewhere; report and save it."""
    check_outputs(arguments.out)
    if arguments.format == "pegs":
        _import_pegs(arguments)
        return
    if arguments.format == "lammps":
        if arguments.contacts is None:
            raise InputError("import lammps needs two dumps: particles and contacts")
        packing = importers.read_lammps(arguments.grains, arguments.contacts, arguments.mu)
    elif arguments.format in ("yade", "mercury"):
        if arguments.contacts is None:
            raise InputError(f"import {arguments.format} needs two files: grains and contacts")
        read = importers.read_yade if arguments.format == "yade" else importers.read_mercury
        packing = read(arguments.grains, arguments.contacts, arguments.mu, box=arguments.box)
    else:
        columns = None if arguments.columns is None else importers.read_columns(arguments.columns)
        packing = importers.read_table(
            arguments.grains,
            arguments.contacts,
            mu=arguments.mu,
            box=arguments.box,
            tilt=arguments.tilt,
            columns=columns,
            forces=True if arguments.forces else None,
            pressure=arguments.pressure,
        )
    lines = importers.report(packing) | {
        k: v for k, v in packing.info.items() if k == "contacts_skipped"
    }
    if arguments.out is not None:
        importers.save_packing(packing, arguments.out)
    print_report(lines, arguments.json)


def _import_pegs(arguments: argparse.Namespace) -> None:
    """Read a photoelastic frame; report and save it, and what was measured."""
    check_outputs(arguments.measured)
    found = importers.read_pegs(
        *(arguments.grains, arguments.contacts),
        mu=arguments.mu,
        frame=arguments.frame,
        **flaws_and_walls(arguments),
    )
    if arguments.out is not None:
        importers.save_packing(found.packing, arguments.out)
    if arguments.measured is not None:
        values = np.concatenate([found.measured, found.sigma], axis=1).T
        columns = {"contact": np.arange(len(found.measured))}
        columns |= dict(zip(importers.measurements.COLUMNS, values, strict=True))
        write_csv(arguments.measured, columns)
    print_report(found.report, arguments.json)


def flaws_and_walls(arguments: argparse.Namespace) -> dict[str, Any]:
    """What the options say of flaws and walls, as `importers.read_pegs` takes it."""
    if arguments.strict and arguments.repair is not None:
        raise InputError("--strict mends nothing: leave out --repair")
    repair = True if arguments.repair is None else arguments.repair
    forces = dict(importers.read_wall_force(text) for text in arguments.wall_force)
    return {
        **{name: getattr(arguments, name) for name in ("reach", "scale", "error", "reverse")},
        "repair": False if arguments.strict else repair,
        "walls": arguments.walls,
        "wall_forces": forces,
    }
