"""The workbench of small scenes, and its builder."""
