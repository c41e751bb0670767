"""What the page computes on demand, as work for jobs.Task; all goes through study and the cache."""

from granforce import study

from .data import SOURCES, Shown

# A compaction's part of the bar; it never seems to be at its end.
PACKING_SHARE, NEARLY = 0.5, 0.95


def states(library, selection):
    """Work that finds or computes the states of a Selection; results in their Shown."""

    def work(job):
        params = selection.parameters()
        cell = library.find(selection.kind, params)
        if cell is None:
            _make_packing(job, library, selection.packing)
            job.begin("states")
            SOURCES[selection.kind][1](
                library.cache,
                params,
                progress=lambda done, total: _tell_states(job, done, total),
                cancel=job.cancelled,
            )
            cell = library.find(selection.kind, params)
        return library.shown(cell)

    return work


def exact(library, shown, workers=2):
    """Work that computes the exact intervals beside what is shown; results in a new Shown."""

    def work(job):
        selection = shown.cell.selection
        library.lend_packing(selection.packing)
        job.begin("exact intervals")
        dataset, _ = study.get_intervals(
            library.cache,
            study.exact_parameters(selection.packing, mu=selection.mu),
            workers=workers,
            progress=job.tell,
            cancel=job.cancelled,
        )
        found = Shown(shown.cell, shown.replay, dataset)
        library.keep_in_memory(found)
        return found

    return work


def _make_packing(job, library, packing):
    library.lend_packing(packing)
    if "imported" in packing:
        return
    steps = library.expected_steps(packing["n"], packing["mu"])

    def tell(step, message):
        job.stage = f"compaction, step {step}: {message}"
        if steps:
            job.tell(min(step, NEARLY * steps), steps, part=(0, PACKING_SHARE))

    job.begin("compaction")
    study.get_packing(library.cache, packing, progress=tell, cancel=job.cancelled)


def _tell_states(job, done, total):
    job.stage = f"{done} of {total} states"
    job.tell(done, total, part=(PACKING_SHARE, 1))
