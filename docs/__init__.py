"""The documentation: hand-written pages, and what their blocks draw and type with."""
