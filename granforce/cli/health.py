"""A server address that reports that the server is alive, for supervisors (Panel's --plugins)."""

from tornado.web import RequestHandler


class Health(RequestHandler):
    """Responds once the server's event loop is free, without a store or a page."""

    def get(self) -> None:
        """{"alive": true}."""
        self.set_header("Cache-Control", "no-store")
        self.write({"alive": True})


ROUTES = [("/health", Health)]
