"""What the paper's two diffusion models share: weights, latents, noise, and the training loop."""
