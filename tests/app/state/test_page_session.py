"""What becomes of a page's work when nobody looks at the page any more."""

from types import SimpleNamespace

import pytest
from bokeh.document import Document

from app.state.page_session import DISCONNECTED_MS, poll_while_running
from app.state.page_tasks import Work

PATIENCE = 60  # s, on a busy machine


class Session(SimpleNamespace):
    """A page's session as Bokeh has it; its browser is connected, or is not for so many ms."""

    connection_count, milliseconds_since_last_unsubscribe = 1, 0.0


@pytest.fixture
def opened():
    """A page with a computation under way: its session, what its document calls, and the job."""
    session, work, document = Session(), Work(), Document()
    document._session_context = lambda: SimpleNamespace(session=session)
    poll_while_running(work, document)
    work.computation.start(lambda job: job._cancel.wait(PATIENCE))
    (poll,) = document.session_callbacks
    yield session, poll.callback, work.computation.job
    work.close()


def test_a_closed_page_computes_no_more(opened):
    session, poll, job = opened
    session.connection_count, session.milliseconds_since_last_unsubscribe = 0, DISCONNECTED_MS + 1.0
    poll()
    assert job.cancelled() and job.wait(PATIENCE)


@pytest.mark.parametrize("connections, ms", [(1, 1e9), (0, DISCONNECTED_MS - 1.0)])
def test_a_page_that_is_looked_at_or_reloaded_goes_on(opened, connections, ms):
    session, poll, job = opened
    session.connection_count, session.milliseconds_since_last_unsubscribe = connections, ms
    poll()
    assert not job.cancelled() and not job.ended
