"""Pictures of small scenes and their S."""
