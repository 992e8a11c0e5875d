"""LuxRemix: every lamp of a photographed room gets a switch, a dimmer and a colour wheel.

Not LuxCoreRender: the name stands for the core of LuxRemix, and nothing is shared with that renderer.
"""

__version__ = "0.1.0"
