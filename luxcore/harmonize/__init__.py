"""The light of a few reference views carried to all views, in chained passes."""
