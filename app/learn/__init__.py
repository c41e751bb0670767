"""Small scenes and the lesson."""
