"""Gains and their certificates: stability, accuracy and the papers' theorems."""
