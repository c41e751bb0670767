"""Files with a few bytes changed, as damaged disks and careless hands leave them."""

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
