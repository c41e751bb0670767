"""Files with a few bytes changed, as damaged disks and careless hands leave them."""

import io
import warnings

import numpy as np

from granforce.records import InputError, InputWarning

PIECES = [
    b"",
    b"0",
    b"-1",
    b"9",
    b"nan",
    b"inf",
    b"1e999",
    b"1e-320",
    b"1e19",
    b"9" * 19,
    b"0.5",
    b",",
    b"\n",
    b" ",
    b'"',
    b"\0",
]


def mutant(contents, rng):
    """The files with one to four changes: bytes replaced, pieces put in or lines moved, cuts."""
    changed = [bytearray(content) for content in contents]
    for _ in range(rng.integers(1, 5)):
        content = changed[rng.integers(len(changed))]
        at = int(rng.integers(len(content) + 1))
        to = min(len(content), at + int(rng.integers(0, 9)))
        change = rng.integers(5)
        if change == 0 and at < len(content):
            content[at] = rng.integers(256)
        elif change == 1:
            content[at:to] = PIECES[rng.integers(len(PIECES))]
        elif change == 2:
            other = int(rng.integers(len(content) + 1))
            content[at:at] = content[other : other + 20]
        elif change == 3:
            del content[at:to]
        elif rng.random() < 0.1:
            del content[at:]
    return [bytes(content) for content in changed]


def refusals(contents, read, count, seed, whole=lambda found: None):
    """How many of so many mutants of files were refused, in one line; warnings are notes on files.

    read(*files): what is in them; whole(found): asserts of what is taken, as of the files
    themselves, that it is whole.
    """

    def refused(contents):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                warnings.simplefilter("ignore", InputWarning)
                found = read(*map(io.BytesIO, contents))
        except InputError as error:
            assert str(error) and "\n" not in str(error)
            return True
        whole(found)
        return False

    assert not refused(contents)
    rng = np.random.default_rng(seed)
    return sum(refused(mutant(contents, rng)) for _ in range(count))
