// Alpha blending of sorted Gaussians, one work-item per 16x16 tile (the mapping for CPUs).
//
// Kerbl et al. 2023, eq. 3: C = sum_i c_i alpha_i T_i, T_i = prod_{j<i} (1 - alpha_j).
// Compile-time: CHANNELS, TILE, ALPHA_MIN, ALPHA_MAX, TRANSMITTANCE_MIN.
#include "common.cl"
#line 7 "raster_block.cl"

__kernel void raster_forward(const int2 size, const int tiles_x, __global const int2 *ranges,
                             __global const int *sorted_ids, __global const float *records,
                             __global const float *colors, __global float *image,
                             __global float *alpha_out, __global float *depth_out) {
  const int tile = get_global_id(0);
  const int x0 = (tile % tiles_x) * TILE, y0 = (tile / tiles_x) * TILE;
  for (int y = y0; y < min(y0 + TILE, size.y); ++y)
    for (int x = x0; x < min(x0 + TILE, size.x); ++x) {
      float T = 1.0f, depth = 0.0f, acc[CHANNELS];
      for (int k = 0; k < CHANNELS; ++k) acc[k] = 0.0f;
      for (int p = ranges[tile].x; p < ranges[tile].y; ++p) {
        const int g = sorted_ids[p];
        const float8 r = vload8(g, records);
        const float dx = r.s0 - (x + 0.5f), dy = r.s1 - (y + 0.5f);
        const float power = 0.5f * (r.s2 * dx * dx + r.s4 * dy * dy) + r.s3 * dx * dy;
        const float alpha = fmin(ALPHA_MAX, r.s5 * exp(-power));
        if (alpha < ALPHA_MIN) continue;
        const float next = T * (1.0f - alpha);
        if (next < TRANSMITTANCE_MIN) break;
        const float w = alpha * T;
        for (int k = 0; k < CHANNELS; ++k) acc[k] += w * colors[g * CHANNELS + k];
        depth += w * r.s6;
        T = next;
      }
      const int pixel = y * size.x + x;
      for (int k = 0; k < CHANNELS; ++k) image[pixel * CHANNELS + k] = acc[k];
      alpha_out[pixel] = 1.0f - T;
      depth_out[pixel] = depth;
    }
}

// Front to back again: with S = sum_i w_i (c_i . d_image) known from the forward image,
// dL/dalpha_i = T_i (c_i . d) - (S - S_{<=i}) / (1 - alpha_i). Nothing divides T back.
__kernel void raster_backward(const int2 size, const int tiles_x, __global const int2 *ranges,
                              __global const int *sorted_ids, __global const int *sorted_slots,
                              __global const float *records, __global const float *colors,
                              __global const float *image, __global const float *alpha_out,
                              __global const float *depth_out, __global const float *d_image,
                              __global const float *d_alpha, __global const float *d_depth,
                              __global float *slots) {
  const int tile = get_global_id(0);
  const int x0 = (tile % tiles_x) * TILE, y0 = (tile / tiles_x) * TILE;
  for (int p = ranges[tile].x; p < ranges[tile].y; ++p)
    for (int k = 0; k < SLOT_SIZE; ++k) slots[sorted_slots[p] * SLOT_SIZE + k] = 0.0f;
  for (int y = y0; y < min(y0 + TILE, size.y); ++y)
    for (int x = x0; x < min(x0 + TILE, size.x); ++x) {
      const int pixel = y * size.x + x;
      __global const float *v = d_image + pixel * CHANNELS;
      float T = 1.0f;
      float rest = alpha_out[pixel] * d_alpha[pixel] + depth_out[pixel] * d_depth[pixel];
      for (int k = 0; k < CHANNELS; ++k) rest += image[pixel * CHANNELS + k] * v[k];
      for (int p = ranges[tile].x; p < ranges[tile].y; ++p) {
        const int g = sorted_ids[p];
        const float8 r = vload8(g, records);
        const float dx = r.s0 - (x + 0.5f), dy = r.s1 - (y + 0.5f);
        const float power = 0.5f * (r.s2 * dx * dx + r.s4 * dy * dy) + r.s3 * dx * dy;
        const float gauss = exp(-power);
        const float raw = r.s5 * gauss, alpha = fmin(ALPHA_MAX, raw);
        if (alpha < ALPHA_MIN) continue;
        const float next = T * (1.0f - alpha);
        if (next < TRANSMITTANCE_MIN) break;
        const float w = alpha * T;
        __global float *slot = slots + sorted_slots[p] * SLOT_SIZE;
        float s = d_alpha[pixel] + d_depth[pixel] * r.s6;
        for (int k = 0; k < CHANNELS; ++k) {
          s += v[k] * colors[g * CHANNELS + k];
          slot[SLOT_COLOR + k] += w * v[k];
        }
        slot[6] += w * d_depth[pixel];
        rest -= w * s;
        const float d_a = T * s - rest / (1.0f - alpha);
        T = next;
        if (raw > ALPHA_MAX) continue;
        slot[5] += gauss * d_a;
        const float d_power = -alpha * d_a;
        slot[0] += d_power * (r.s2 * dx + r.s3 * dy);
        slot[1] += d_power * (r.s4 * dy + r.s3 * dx);
        slot[2] += d_power * 0.5f * dx * dx;
        slot[3] += d_power * dx * dy;
        slot[4] += d_power * 0.5f * dy * dy;
      }
    }
}

// Sums the slots of each Gaussian in slot order: the same bits on any number of threads.
__kernel void reduce_slots(const int n, __global const int *offsets, __global const int *counts,
                           __global const float *slots, __global float *d_records,
                           __global float *d_colors) {
  const int i = get_global_id(0);
  if (i >= n) return;
  float sum[SLOT_SIZE];
  for (int k = 0; k < SLOT_SIZE; ++k) sum[k] = 0.0f;
  const int end = offsets[i] + counts[i];
  for (int s = offsets[i]; s < end; ++s)
    for (int k = 0; k < SLOT_SIZE; ++k) sum[k] += slots[s * SLOT_SIZE + k];
  for (int k = 0; k < SLOT_COLOR; ++k) d_records[i * 8 + k] = sum[k];
  for (int k = 0; k < CHANNELS; ++k) d_colors[i * CHANNELS + k] = sum[SLOT_COLOR + k];
}
