"""One photo's light taken apart: ambient, one image per lamp, and the factors that rebuild it."""
