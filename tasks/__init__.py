"""One module per stage: where its inputs are, which library function does it, what is logged."""
