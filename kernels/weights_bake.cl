// Blending weights of a view, baked while geometry is frozen (applied by weights_apply.cl).
//
// W is held by quads of 2x2 pixels. An entry of a quad is a row and four weights, nearest Gaussian
// first. A row is a Gaussian that is drawn in a tile. Quads lie tile by tile, in a tile 4x4 block by
// block. One work-item per tile walks the sorted lists as raster_block_forward.cl does, sees the
// same alphas and stops where it stops: first with FILL 0, which counts, then with FILL 1.
// Compile-time: FILL, CHUNK and the constants of blending.cl.
#define FEATURES 0
#include "block_chunk.cl"
#line 11 "weights_bake.cl"

#define QUADS 4  // of a block
#define QUAD_WEIGHTS(w) {(w).s0145, (w).s2367, (w).s89cd, (w).sabef}

#if FILL
// `start` [quads + 1] says where each quad's entries go, pair_rows [pairs] is the row of each pair.
#define RESULTS                                                                                  \
  __global const int *start, __global const int *pair_rows, __global int *rows,                  \
      __global float *weights
#define QUAD_START(quad) start[quad]
#else
// counts [quads]; drawn [pairs] must be 0 before.
#define RESULTS __global int *counts, __global uchar *drawn
#define QUAD_START(quad) 0
#endif

__kernel __attribute__((reqd_work_group_size(1, 1, 1))) void weights_bake(
    const int2 size, const int tiles_x, __global const int2 *ranges,
    __global const int *sorted_ids, __global const float *records, RESULTS) {
  const int tile = get_global_id(0);
  const int x0 = (tile % tiles_x) * TILE, y0 = (tile / tiles_x) * TILE;
  const int2 range = ranges[tile];
  Chunk chunk;
  float16 T[BLOCKS];
  int next[BLOCKS][QUADS];
  int open = 0;  // bit b: block b has unfinished pixels
  for (int b = 0; b < BLOCKS; ++b) {
    const float16 px = x0 + (b & 3) * 4 + LANE_X, py = y0 + (b >> 2) * 4 + LANE_Y;
    const int16 inside = px < size.x && py < size.y;
    T[b] = inside ? (float16)(1.0f) : (float16)(0.0f);
    open |= any(inside) << b;
    for (int q = 0; q < QUADS; ++q) next[b][q] = QUAD_START((tile * BLOCKS + b) * QUADS + q);
  }
  for (int begin = range.x; begin < range.y && open; begin += CHUNK) {
    const int count = min(CHUNK, range.y - begin);
    load_records(&chunk, begin, count, x0, y0, sorted_ids, records);
    uint bits[CHUNK_WORDS][BLOCKS];
    list_by_block(&chunk, count, bits);
    for (int b = 0; b < BLOCKS; ++b) {
      if (!(open >> b & 1)) continue;
      const float16 px = x0 + (b & 3) * 4 + 0.5f + LANE_X, py = y0 + (b >> 2) * 4 + 0.5f + LANE_Y;
      for (int word = 0; word < CHUNK_WORDS; ++word)
        for (uint left = bits[word][b]; left && any_lane(T[b]); left &= left - 1) {
          const int i = 32 * word + popcount(~left & (left - 1));
          const float16 weight = next_weight(&T[b], chunk.record[i], px, py);
          if (!any_lane(weight)) continue;
          const float4 quads[QUADS] = QUAD_WEIGHTS(weight);
#if FILL
          for (int q = 0; q < QUADS; ++q) {
            if (!any(quads[q] > 0.0f)) continue;
            rows[next[b][q]] = pair_rows[begin + i];
            vstore4(quads[q], next[b][q]++, weights);
          }
#else
          drawn[begin + i] = 1;
          for (int q = 0; q < QUADS; ++q) next[b][q] += any(quads[q] > 0.0f);
#endif
        }
      if (!any_lane(T[b])) open &= ~(1 << b);
    }
  }
#if !FILL
  for (int b = 0; b < BLOCKS; ++b)
    for (int q = 0; q < QUADS; ++q) counts[(tile * BLOCKS + b) * QUADS + q] = next[b][q];
#endif
}
