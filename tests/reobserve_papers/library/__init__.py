"""Tests of every call of plants, signals and functions of the papers."""
