#version 300 es
// Mixes the one-light-at-a-time layers in linear light, exposes, tone-maps with AgX.
// Layers hold 8-bit logarithmic codes: value = (2^(code * span) - 1) / SLOPE, already times the
// capture's exposure and the lamp's level in the photo. LAYERS and SLOPE are set when this page is
// written.
precision highp float;
precision highp sampler2DArray;

#define LAYERS {{ layers }}
#define SLOPE {{ slope }}

uniform sampler2DArray layers;
uniform sampler2D photo;
uniform vec3 weights[LAYERS];
uniform float spans[LAYERS];
uniform float gain;
uniform float split_px;
uniform bool flip;

out vec4 colour;

{{ agx }}

void main() {
  ivec2 size = textureSize(photo, 0);
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  if (flip) pixel.y = size.y - 1 - pixel.y;
  if (gl_FragCoord.x < split_px) {
    colour = vec4(texelFetch(photo, pixel, 0).rgb, 1.0);
    return;
  }
  vec3 radiance = vec3(0.0);
  for (int i = 0; i < LAYERS; ++i) {
    vec3 code = texelFetch(layers, ivec3(pixel, i), 0).rgb;
    radiance += weights[i] * (exp2(code * spans[i]) - 1.0) / SLOPE;
  }
  colour = vec4(agx(radiance * gain), 1.0);
}
