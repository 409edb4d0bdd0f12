"""What an observer is told of a plant."""
