"""Tests of the tables of equations."""
