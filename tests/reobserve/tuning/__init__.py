"""Tests of tuning and of tasks."""
