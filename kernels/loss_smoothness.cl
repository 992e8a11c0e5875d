// Smoothness of light among neighbours: 1/(NK) Σ_i Σ_{j in N(i)} |L_i - L_j|² (supplement,
// L_smooth) and its gradient, one work-item per Gaussian.
//
// `start` [n + 1] and `other` list, for each Gaussian, its neighbours and those whose neighbour it
// is, with repetition: every pair appears once from either side, so that the gradient is a gather
// in a fixed order, without atomics. Each pair therefore counts twice in `sums`.
// Torch twin: luxcore/splats/losses/twin.py::smoothness_loss.
// Compile-time: CHANNELS.
#line 11 "loss_smoothness.cl"

__kernel void smoothness(__global const float *lights, __global const int *start,
                         __global const int *other, const int n, const float scale,
                         __global float *d_lights, __global float *sums) {
  const int i = get_global_id(0);
  if (i >= n) return;
  __global const float *own = lights + (size_t)i * CHANNELS;
  __global float *out = d_lights + (size_t)i * CHANNELS;
  float total = 0.0f;
  for (int e = start[i]; e < start[i + 1]; ++e) {
    __global const float *theirs = lights + (size_t)other[e] * CHANNELS;
    for (int c = 0; c < CHANNELS; ++c) {
      const float difference = own[c] - theirs[c];
      out[c] += 2.0f * scale * difference;
      total += difference * difference;
    }
  }
  sums[i] = total;
}
