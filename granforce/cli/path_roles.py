"""Roles of paths in command lines: read, written, or added to."""

from __future__ import annotations

from granforce.system.series import numbered_files


class Input(str):
    """A file or folder that a command reads."""


class Series(str):
    """A file that a command reads, or its numbered files."""

    @property
    def files(self) -> list[Input]:
        return [Input(name) for name in numbered_files(self)]


class Output(str):
    """A file or folder that a command writes, replacing an existing one."""


class Workplace(str):
    """A folder to which a command adds files."""


class StorePath(str):
    """A store of results, which a command reads and adds to."""


class Edited(str):
    """Files, separated by commas, in which a command replaces a part."""

    @property
    def files(self) -> list[Output]:
        return [Output(name) for name in self.split(",") if name]


class TableOrStore(str):
    """A table (.csv), which is replaced, or a store of results."""

    @property
    def files(self) -> list[Output | StorePath]:
        return [Output(self) if self.endswith(".csv") else StorePath(self)]


ROLES = (Input, Series, Output, Workplace, StorePath, Edited, TableOrStore)
