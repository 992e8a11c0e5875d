"""The paper's single-view model: FLUX.1 Kontext, LoRA, and a lamp's mask as added tokens."""
