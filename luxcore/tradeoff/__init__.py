"""What accuracy costs in time: every knob that trades one for the other, measured and drawn."""
