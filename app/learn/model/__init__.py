"""S of a small scene."""
