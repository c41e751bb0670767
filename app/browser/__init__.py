"""How scripts are joined and talk to the server."""
