"""Work off the event loop, and the limits of a shared server."""
