"""Work off the event loop, and limits of a shared server."""
