// Sums the partial gradients of each Gaussian, in the order of its slots: the same bits on any number
// of threads.
//
// One work-item per Gaussian in depth order, n of them. A row of partials holds 6 moments (none
// with COLORS_ONLY), CHANNELS colours and, WITH_DEPTH, the depth. Compile-time: COLORS_ONLY, CHANNELS, WITH_DEPTH, PARTIAL_SIZE (a multiple
// of 4).
#line 8 "gather_partials.cl"

#ifndef COLORS_ONLY
#define COLORS_ONLY 0
#endif
#if COLORS_ONLY
#define MOMENTS 0
#else
#define MOMENTS 6
#endif

__kernel void gather_partials(const int n, __global const int *order, __global const int *offsets,
                              __global const int *slot_positions, __global const float *partials,
                              __global const uchar *touched, __global float *moments,
                              __global float *d_colors) {
  const int k = get_global_id(0);
  if (k >= n) return;
  const int i = order[k];
  float4 sum[PARTIAL_SIZE / 4];
#pragma unroll
  for (int v = 0; v < PARTIAL_SIZE / 4; ++v) sum[v] = (float4)(0.0f);
  const int end = offsets[k + 1];
  for (int slot = offsets[k]; slot < end; ++slot) {
    const int row = slot_positions[slot];
    if (!touched[row]) continue;
#pragma unroll
    for (int v = 0; v < PARTIAL_SIZE / 4; ++v)
      sum[v] += vload4(v, partials + (size_t)row * PARTIAL_SIZE);
  }
  float values[PARTIAL_SIZE];
#pragma unroll
  for (int v = 0; v < PARTIAL_SIZE / 4; ++v) vstore4(sum[v], v, values);
#if !COLORS_ONLY
  for (int m = 0; m < MOMENTS; ++m) moments[(size_t)i * 8 + m] = values[m];
  moments[(size_t)i * 8 + MOMENTS] = WITH_DEPTH ? values[MOMENTS + CHANNELS] : 0.0f;
#endif
  for (int c = 0; c < CHANNELS; ++c) d_colors[(size_t)i * CHANNELS + c] = values[MOMENTS + c];
}
