"""Drawing of packings."""
