"""Tests of every observer and of every call of the library."""
