"""Parts that go."""
