"""Results that are kept: kinds, cells, schema, store, scans."""
