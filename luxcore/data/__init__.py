"""Rendered rooms as data: reading and writing them, and sampling training photos from them."""
