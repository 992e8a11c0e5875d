"""The tables: how well light is taken apart and carried on, against truth and simple baselines."""
