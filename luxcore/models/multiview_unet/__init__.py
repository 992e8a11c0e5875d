"""The paper's multi-view model: a latent diffusion U-Net whose self-attention spans the views."""
