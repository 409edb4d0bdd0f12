"""The documentation: its pages, and what runs their code and keeps its outputs in them."""
