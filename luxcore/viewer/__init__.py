"""The interactive viewer of a relightable scene."""
