"""LuxRemix: every lamp of a photographed room gets a switch, a dimmer and a colour wheel.

Not LuxCoreRender: the name is short for the core of LuxRemix; nothing of that renderer is in it.
"""

__version__ = "0.1.0"
