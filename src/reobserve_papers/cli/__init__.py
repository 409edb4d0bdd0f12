"""The command line of the papers: a module for each family of sub-commands."""
