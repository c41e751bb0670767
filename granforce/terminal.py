"""What commands print: reports and tables on stdout, progress on stderr."""

import json
import sys

from tqdm import tqdm


def print_list(rows, names, as_json):
    if as_json:
        print(json.dumps(rows, indent=1))
    else:
        table(rows, names, {})


def report(lines, as_json):
    """A report on stdout: names and numbers in two columns, or JSON."""
    if as_json:
        print(json.dumps(lines, indent=1))
        return
    width = max(len(name) for name in lines)
    for name, value in lines.items():
        print(f"{name.replace('_', ' '):<{width}}  {text(value)}")


def table(rows, names, heads):
    cells = [[heads.get(name, name) for name in names]]
    cells += [[text(line[name]) for name in names] for line in rows]
    widths = [max(len(line[k]) for line in cells) for k in range(len(names))]
    for line in cells:
        print("  ".join(f"{cell:>{width}}" for cell, width in zip(line, widths, strict=True)))


def text(value):
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, (list, tuple)):
        return " ".join(text(part) for part in value)
    return f"{value:.4g}" if isinstance(value, float) else str(value)


class Bar:
    """A tqdm bar on stderr that a progress(done, total) callable drives; gone when not used."""

    def __init__(self, label, unit):
        self.label, self.unit, self.bar = label, unit, None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.bar is not None:
            self.bar.close()

    def __call__(self, done, total):
        if self.bar is None:
            self.bar = tqdm(total=total, desc=self.label, unit=self.unit, file=sys.stderr)
        self.bar.update(done - self.bar.n)


class Steps(Bar):
    """The same for work whose end is not known: progress(step, message)."""

    def __call__(self, step, message):
        super().__call__(step, None)
        self.bar.set_postfix_str(message)
