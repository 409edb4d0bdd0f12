"""The observers, one algorithm a file: import the one you need from its module."""
