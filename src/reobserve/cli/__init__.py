"""What can be typed: a module for each family of sub-commands, which names what they run."""
