// Sums the slots of each Gaussian in slot order: the same bits on any number of threads.
//
// One work-item per Gaussian, n of them. A slot holds 6 moments, CHANNELS colours and, WITH_DEPTH,
// the depth. Compile-time: CHANNELS, WITH_DEPTH, SLOT_SIZE (a multiple of 4).
#line 6 "gather_slots.cl"

#define MOMENTS 6

__kernel void gather_slots(const int n, __global const int *offsets,
                           __global const int *tile_counts, __global const float *slots,
                           __global const uchar *touched, __global float *moments,
                           __global float *d_colors) {
  const int i = get_global_id(0);
  if (i >= n) return;
  float4 sum[SLOT_SIZE / 4];
#pragma unroll
  for (int k = 0; k < SLOT_SIZE / 4; ++k) sum[k] = (float4)(0.0f);
  const int end = offsets[i] + tile_counts[i];
  for (int slot = offsets[i]; slot < end; ++slot) {
    if (!touched[slot]) continue;
#pragma unroll
    for (int k = 0; k < SLOT_SIZE / 4; ++k)
      sum[k] += vload4(0, slots + (size_t)slot * SLOT_SIZE + 4 * k);
  }
  float values[SLOT_SIZE];
#pragma unroll
  for (int k = 0; k < SLOT_SIZE / 4; ++k) vstore4(sum[k], k, values);
  for (int k = 0; k < MOMENTS; ++k) moments[(size_t)i * 8 + k] = values[k];
  moments[(size_t)i * 8 + MOMENTS] = WITH_DEPTH ? values[MOMENTS + CHANNELS] : 0.0f;
  for (int k = 0; k < CHANNELS; ++k) d_colors[(size_t)i * CHANNELS + k] = values[MOMENTS + k];
}
