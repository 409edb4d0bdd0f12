"""The programs of observers: a module for each family."""
