"""The tests that a change touches, in under a minute, for the loop while editing."""
