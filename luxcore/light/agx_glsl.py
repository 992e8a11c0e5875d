"""AgX for the browser: GLSL written out from the constants that the Python form uses.

The formula is evaluated at the four corners of a tetrahedron of the 57³ lattice, so that no table
has to be uploaded.
"""

from __future__ import annotations

import numpy as np

from luxcore.light import agx_constants as k

_HEAD = """\
// AgX: linear Rec.709 radiance (vec3) to an sRGB-encoded display colour in 0..1.
// Twin: luxcore.light.agx.agx. GLSL ES 3.00: call agx(colour) in a fragment shader.
"""

_BODY = """\
float agx_max3(vec3 c) { return max(c.x, max(c.y, c.z)); }
float agx_min3(vec3 c) { return min(c.x, min(c.y, c.z)); }

float agx_luminance(vec3 c, vec3 weights, bool fade) {
    float luminance = dot(c, weights);
    vec3 opponent = vec3(agx_max3(c)) - c;
    float missing = agx_max3(opponent) - dot(opponent, weights);
    float share = fade ? pow(clamp(luminance, @tiny@, @one@), @fade@) : @zero@;
    return luminance + (@one@ - share) * missing;
}

vec3 agx_guard_rail(vec3 c, vec3 weights, bool fade) {
    float lowest = agx_min3(c);
    if (lowest >= @zero@) return c;
    vec3 lifted = c - vec3(lowest);
    float before = agx_luminance(c, weights, fade);
    float after = agx_luminance(lifted, weights, fade);
    return lifted * clamp(before / max(after, @tiny@), @zero@, @one@);
}

float agx_curve(float radiance) {
    float x = (log2(max(radiance, @floor@) / @grey@) - @min_ev@) / @span_ev@;
    float scale = x < @pivot_x@ ? @toe@ : @shoulder@;
    float term = @slope@ * (x - @pivot_x@) / scale;
    float rise = term / pow(@one@ + pow(max(term, @zero@), @power@), @power_inverse@);
    return pow(max(scale * rise + @pivot_y@, @zero@), @gamma@);
}

// Encoded colour at one node; `node` counts cells along the E-Gamut axes.
vec3 agx_node(vec3 node) {
    vec3 e = @grey@ * exp2(node * @stops_per_cell@ + vec3(@min_ev@));
    vec3 wide = vec3(@REC2020_FROM_E * e@);
    vec3 railed = agx_guard_rail(wide, vec3(@LUMINANCE_2020@), false);
    vec3 scene = vec3(@INSET * railed@);
    vec3 formed = vec3(agx_curve(scene.x), agx_curve(scene.y), agx_curve(scene.z));
    float low = agx_min3(scene);
    float span = agx_max3(scene) - low;
    if (span > @grey_span@ * (low + span)) {
        float formed_low = agx_min3(formed);
        float formed_span = agx_max3(formed) - formed_low;
        vec3 kept = vec3(formed_low) + (scene - vec3(low)) * (formed_span / span);
        formed = mix(kept, formed, @hue_mix@);
    }
    vec3 narrow = vec3(@REC709_FROM_SCENE * formed@);
    vec3 shown = agx_guard_rail(narrow, vec3(@LUMINANCE_709@), true);
    return pow(clamp(shown, @zero@, @one@), vec3(@gamma_inverse@));
}

float agx_srgb(float v) {
    return v <= @srgb_knee@ ? v * @srgb_slope@ : @srgb_gain@ * pow(v, @gamma_inverse@) - @srgb_off@;
}

vec3 agx(vec3 radiance) {
    vec3 bounded = clamp(radiance, vec3(-@ceiling@), vec3(@ceiling@));
    vec3 e = clamp(vec3(@E_FROM_709 * bounded@), vec3(@floor@), vec3(@ceiling@));
    vec3 position = (log2(e / @grey@) - vec3(@min_ev@)) * @cells_per_stop@;
    vec3 base = min(floor(position), vec3(@last_cell@));
    vec3 f = position - base;
    vec3 x = vec3(@one@, @zero@, @zero@);
    vec3 y = vec3(@zero@, @one@, @zero@);
    vec3 z = vec3(@zero@, @zero@, @one@);
    vec3 first = f.x >= f.y ? (f.x >= f.z ? x : z) : (f.y >= f.z ? y : z);
    vec3 last = (f.z <= f.y && f.z <= f.x) ? z : (f.y <= f.x ? y : x);
    float high = agx_max3(f);
    float low = agx_min3(f);
    float middle = f.x + f.y + f.z - high - low;
    vec3 encoded = agx_node(base) * (@one@ - high)
        + agx_node(base + first) * (high - middle)
        + agx_node(base + vec3(@one@) - last) * (middle - low)
        + agx_node(base + vec3(@one@)) * low;
    vec3 light = pow(max(encoded, vec3(@zero@)), vec3(@gamma@));
    return vec3(agx_srgb(light.x), agx_srgb(light.y), agx_srgb(light.z));
}
"""


def source() -> str:
    """GLSL ES 3.00 text that defines `vec3 agx(vec3 radiance)`: linear Rec.709 to sRGB display."""
    text = f"{_HEAD}\n{_BODY}"
    for name, value in _scalars().items():
        text = text.replace(f"@{name}@", _literal(value))
    for name, weights in _weights().items():
        text = text.replace(f"@{name}@", ", ".join(_literal(w) for w in weights))
    for name, (matrix, vector) in _products().items():
        rows = ",\n        ".join(_row(row, vector) for row in matrix)
        text = text.replace(f"@{name} * {vector}@", rows)
    return text


def _scalars() -> dict[str, float]:
    span = k.MAX_EV - k.MIN_EV
    lattice_span, cells = k.LATTICE_MAX_EV - k.LATTICE_MIN_EV, k.LATTICE_SIZE - 1
    return {
        "zero": 0.0, "one": 1.0, "tiny": 1e-12, "grey": k.MIDDLE_GREY, "grey_span": 1e-6,
        "min_ev": k.MIN_EV, "span_ev": span, "floor": k.LINEAR_FLOOR,
        "ceiling": k.MIDDLE_GREY * 2.0**k.LATTICE_MAX_EV,
        "pivot_x": k.PIVOT_X, "pivot_y": k.PIVOT_Y, "slope": k.SLOPE,
        "toe": k.TOE_SCALE, "shoulder": k.SHOULDER_SCALE,
        "power": k.POWER, "power_inverse": 1.0 / k.POWER,
        "gamma": k.DISPLAY_GAMMA, "gamma_inverse": 1.0 / k.DISPLAY_GAMMA,
        "hue_mix": k.HUE_MIX, "fade": k.COMPENSATION_POWER,
        "stops_per_cell": lattice_span / cells, "cells_per_stop": cells / lattice_span,
        "last_cell": cells - 1.0,
        "srgb_knee": 0.0031308, "srgb_slope": 12.92, "srgb_gain": 1.055, "srgb_off": 0.055,
    }  # fmt: skip


def _weights() -> dict[str, np.ndarray]:
    return {"LUMINANCE_2020": k.CIE2015_LUMINANCE_2020, "LUMINANCE_709": k.CIE2015_LUMINANCE_709}


def _products() -> dict[str, tuple[np.ndarray, str]]:
    return {
        "REC2020_FROM_E": (k.REC2020_FROM_709 @ k.REC709_FROM_E, "e"),
        "INSET": (k.INSET, "railed"),
        "REC709_FROM_SCENE": (k.REC709_FROM_2020 @ k.OUTSET, "formed"),
        "E_FROM_709": (k.E_FROM_709, "bounded"),
    }


def _row(row: np.ndarray, vector: str) -> str:
    return " + ".join(f"{_literal(v)} * {vector}.{c}" for v, c in zip(row, "xyz", strict=True))


def _literal(value: float) -> str:
    text = f"{value:.9g}"
    if not any(c in text for c in ".e"):
        text += ".0"
    return f"({text})" if value < 0 else text
