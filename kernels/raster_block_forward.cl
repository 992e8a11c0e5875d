// Alpha blending of sorted Gaussians, one work-item per 16x16 tile: the mapping for CPUs.
//
// Kerbl et al. 2023, eq. 3: C = sum_i c_i alpha_i T_i, T_i = prod_{j<i} (1 - alpha_j).
// Per chunk of Gaussians, then per 4x4 block of pixels, then per Gaussian that reaches the block:
// the block's colours stay in registers while the Gaussians pass by.
// `used[tile]` receives how many Gaussians were looked at before every pixel was finished.
// Compile-time: CHANNELS, CHUNK, ALPHA_MIN, ALPHA_MAX, TRANSMITTANCE_MIN.
#define FEATURES (CHANNELS + 1)
#include "block_chunk.cl"
#line 11 "raster_block_forward.cl"

typedef struct {
  float16 T;                   // 0 once the pixel is finished
  float16 alpha;               // sum of weights
  float16 features[FEATURES];  // sum of weight times feature
} Block;

inline void blend(Block *block, const Chunk *chunk, const int i, const float16 px,
                  const float16 py) {
  const float16 weight = next_weight(&block->T, chunk->record[i], px, py);
  block->alpha += weight;
#pragma unroll
  for (int k = 0; k < FEATURES; ++k)
    block->features[k] = fma(weight, chunk->features[i * FEATURES + k], block->features[k]);
}

void write_block(const Block *block, const int x0, const int y0, const int2 size,
                 __global float *image, __global float *alpha, __global float *depth) {
  float alphas[16], features[FEATURES][16];
  vstore16(block->alpha, 0, alphas);
  for (int k = 0; k < FEATURES; ++k) vstore16(block->features[k], 0, features[k]);
  for (int lane = 0; lane < 16; ++lane) {
    const int x = x0 + (lane & 3), y = y0 + (lane >> 2);
    if (x >= size.x || y >= size.y) continue;
    const size_t pixel = (size_t)y * size.x + x;
    alpha[pixel] = alphas[lane];
    depth[pixel] = features[CHANNELS][lane];
    for (int k = 0; k < CHANNELS; ++k) image[pixel * CHANNELS + k] = features[k][lane];
  }
}

__kernel __attribute__((reqd_work_group_size(1, 1, 1))) void raster_forward(
    const int2 size, const int tiles_x, __global const int2 *ranges,
    __global const int *sorted_ids, __global const float *records, __global const float *colors,
    __global float *image, __global float *alpha, __global float *depth, __global int *used) {
  const int tile = get_global_id(0);
  const int x0 = (tile % tiles_x) * TILE, y0 = (tile / tiles_x) * TILE;
  const int2 range = ranges[tile];
  Chunk chunk;
  Block blocks[BLOCKS];
  int open = 0;  // bit b: block b has unfinished pixels
  for (int b = 0; b < BLOCKS; ++b) {
    const float16 px = x0 + (b & 3) * 4 + LANE_X, py = y0 + (b >> 2) * 4 + LANE_Y;
    const int16 inside = px < size.x && py < size.y;
    blocks[b].T = inside ? (float16)(1.0f) : (float16)(0.0f);
    blocks[b].alpha = (float16)(0.0f);
#pragma unroll
    for (int k = 0; k < FEATURES; ++k) blocks[b].features[k] = (float16)(0.0f);
    open |= any(inside) << b;
  }
  int begin = range.x;
  for (; begin < range.y && open; begin += CHUNK) {
    const int count = min(CHUNK, range.y - begin);
    load_chunk(&chunk, begin, count, x0, y0, sorted_ids, records, colors);
    uint bits[CHUNK_WORDS][BLOCKS];
    list_by_block(&chunk, count, bits);
    for (int b = 0; b < BLOCKS; ++b) {
      if (!(open >> b & 1)) continue;
      Block block = blocks[b];
      const float16 px = x0 + (b & 3) * 4 + 0.5f + LANE_X, py = y0 + (b >> 2) * 4 + 0.5f + LANE_Y;
      for (int word = 0; word < CHUNK_WORDS; ++word)
        // Without the test a fifth of the visits would come after the last pixel is finished.
        for (uint left = bits[word][b]; left && any_lane(block.T); left &= left - 1)
          blend(&block, &chunk, 32 * word + popcount(~left & (left - 1)), px, py);
      blocks[b] = block;
      if (!any_lane(block.T)) open &= ~(1 << b);
    }
  }
  used[tile] = min(begin, range.y) - range.x;
  for (int b = 0; b < BLOCKS; ++b)
    write_block(&blocks[b], x0 + (b & 3) * 4, y0 + (b >> 2) * 4, size, image, alpha, depth);
}
