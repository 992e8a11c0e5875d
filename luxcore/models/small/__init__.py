"""The project's own model: light fractions by a small U-Net, trained here, shipped, CPU first."""
