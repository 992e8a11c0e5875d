"""Lamp designs: each draws a `LampPiece` whose emitting shares add up to one."""
