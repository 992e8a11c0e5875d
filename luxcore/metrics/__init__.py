"""Scores of a predicted image against the truth, as the paper reports them."""
