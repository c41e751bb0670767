"""Packings: compaction, scenes, import, export and storage."""
