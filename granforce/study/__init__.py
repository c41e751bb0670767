"""Stored results: kinds, cells, schema, store and scans."""
