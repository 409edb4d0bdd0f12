"""Metrics of estimates."""
