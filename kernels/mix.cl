// Relighting from a fixed camera: image = Σ_m w_m · layer_m, w per colour (paper, section 3.4).
// layers [M, pixels · 3], weights [M, 3], image [pixels · 3]. One work-item per 16 pixels: three
// float16s hold them, and the colours repeat with period 3. Compile-time: LIGHTS.
#line 5 "mix.cl"

__kernel void mix_layers(__global const float *layers, __global const float *weights,
                         const int size, __global float *image) {
  const int first = get_global_id(0) * 48;
  if (first + 48 > size) {
    for (int i = first; i < size; ++i) {
      float sum = 0.0f;
      for (int m = 0; m < LIGHTS; ++m)
        sum = fma(weights[3 * m + i % 3], layers[(size_t)m * size + i], sum);
      image[i] = sum;
    }
    return;
  }
  float16 a = 0.0f, b = 0.0f, c = 0.0f;
  for (int m = 0; m < LIGHTS; ++m) {
    const float3 w = vload3(m, weights);
    const float16 w0 = w.s0120120120120120, w1 = w.s1201201201201201, w2 = w.s2012012012012012;
    __global const float *layer = layers + (size_t)m * size + first;
    a = fma(w0, vload16(0, layer), a);
    b = fma(w1, vload16(1, layer), b);
    c = fma(w2, vload16(2, layer), c);
  }
  vstore16(a, 0, image + first);
  vstore16(b, 1, image + first);
  vstore16(c, 2, image + first);
}
