"""The assumptions of a paper: read, overridden, checked, and as types."""
