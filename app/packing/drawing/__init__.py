"""How packings are drawn."""
