"""Models that take the light of photos apart: one interface, several backends."""
