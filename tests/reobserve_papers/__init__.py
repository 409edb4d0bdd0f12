"""Tests of the papers; the folders mirror their packages."""
