"""Losses of the splats on the device, each with a torch twin (`twin`)."""
