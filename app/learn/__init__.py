"""The lesson and the workbench of small scenes."""
