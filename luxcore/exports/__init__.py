"""Files that other tools open, made of a relightable scene or of a capture."""
