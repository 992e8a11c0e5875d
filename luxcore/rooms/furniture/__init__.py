"""Furniture built of recognisable parts; every function draws one `Piece` from a generator."""
