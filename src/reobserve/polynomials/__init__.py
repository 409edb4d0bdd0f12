"""Truncated power series in several variables: the arithmetic that normal forms are made of."""
