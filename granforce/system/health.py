"""An address of a server that says that it is alive: of Panel's --plugins, for supervisors."""

from tornado.web import RequestHandler


class Health(RequestHandler):
    """Answers once the server's loop has its turn; asks no store and makes no page."""

    def get(self) -> None:
        """{"alive": true}."""
        self.set_header("Cache-Control", "no-store")
        self.write({"alive": True})


ROUTES = [("/health", Health)]
