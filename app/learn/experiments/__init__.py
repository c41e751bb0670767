"""The experiments of the chapters, one class per chapter or kind of chapter."""
