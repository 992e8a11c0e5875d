// A chunk of a tile's sorted Gaussians in private memory, and which 4x4 blocks each one reaches.
//
// For the block mapping only. A tile is 4x4 blocks of 4x4 pixels; lane i of a float16 is pixel
// (i % 4, i / 4) of a block. Coverage is exact: for each row of blocks, the widest chord of the
// ellipse alpha >= ALPHA_MIN within it. 16 Gaussians are tested at once, one per lane.
// Compile-time: CHUNK (a multiple of 32), FEATURES (floats blended per Gaussian, may be 0).
#include "blending.cl"
#line 9 "block_chunk.cl"

#define BLOCKS 16
#define CHUNK_WORDS (CHUNK / 32)

#define LANE_X ((float16)(0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3))
#define LANE_Y ((float16)(0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3))
#define LANES ((int16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15))

typedef struct {
  float8 record[CHUNK];
#if FEATURES
  float features[CHUNK * FEATURES];  // colours, then depth
#endif
  int blocks[CHUNK];                 // bit b: block b is reached
} Chunk;

// Bit b of lane i: Gaussian i reaches a pixel centre of block b of the tile at (x0, y0).
int16 reached_blocks(const float8 *record, const float x0, const float y0) {
  float field[7][16];
  for (int i = 0; i < 16; ++i) {
    field[0][i] = RECORD_X(record[i]) - x0;
    field[1][i] = RECORD_Y(record[i]) - y0;
    field[2][i] = -RECORD_A(record[i]);
    field[3][i] = -0.5f * RECORD_B(record[i]);
    field[4][i] = -RECORD_C(record[i]);
    field[5][i] = RECORD_L(record[i]) - LOG2_ALPHA_MIN;
    field[6][i] = RECORD_DET(record[i]);
  }
  const Ellipse_block e = ellipse_block(
      vload16(0, field[0]), vload16(0, field[1]), vload16(0, field[2]), vload16(0, field[3]),
      vload16(0, field[4]), vload16(0, field[5]), vload16(0, field[6]));
  int16 blocks = (int16)(0);
#pragma unroll
  for (int row = 0; row < 4; ++row) {
    float16 left, right;
    const float16 found = chord_block(e, (float16)(row * 4 + 0.5f), (float16)(row * 4 + 3.5f),
                                      &left, &right);
    // Block k of the row has its pixel centres at 4 k + 0.5 .. 4 k + 3.5. Rounding up and down is
    // done by truncation, which never loses a block.
    const int16 first = convert_int16(min(max(left - 3.5f, 0.0f) * 0.25f + 0.998f, 4.0f));
    const int16 end = convert_int16(min(max(right + 3.5f, 0.0f) * 0.25f, 4.0f));
    const int16 bits = ((int16)(1) << end) - ((int16)(1) << first);
    blocks |= found >= 0.0f ? bits << (4 * row) : (int16)(0);
  }
  return blocks;
}

// Gathers the Gaussians sorted_ids[begin .. begin + count) and finds their blocks.
void load_records(Chunk *chunk, const int begin, const int count, const float x0, const float y0,
                  __global const int *sorted_ids, __global const float *records) {
  for (int i = 0; i < count; ++i) chunk->record[i] = vload8(sorted_ids[begin + i], records);
  for (int i = 0; i < count; i += 16)
    vstore16(i + LANES < count ? reached_blocks(chunk->record + i, x0, y0) : (int16)(0), 0,
             chunk->blocks + i);
}

#if FEATURES
// The same, with what is blended.
void load_chunk(Chunk *chunk, const int begin, const int count, const float x0, const float y0,
                __global const int *sorted_ids, __global const float *records,
                __global const float *colors) {
  for (int i = 0; i < count; ++i) {
    const int g = sorted_ids[begin + i];
    for (int k = 0; k < CHANNELS; ++k)
      chunk->features[i * FEATURES + k] = colors[(size_t)g * CHANNELS + k];
#if FEATURES > CHANNELS
    chunk->features[i * FEATURES + CHANNELS] = records[(size_t)g * 8 + 6];
#endif
  }
  load_records(chunk, begin, count, x0, y0, sorted_ids, records);
}
#endif

// bits[b]: bit i says that Gaussian i of these 32 reaches block b.
uint16 transpose_bits(const int *blocks) {
  uint16 bits = (uint16)(0);
  for (int i = 0; i < 32; ++i)
    bits = (bits >> 1) | (((uint16)(blocks[i]) >> convert_uint16(LANES)) << 31);
  return bits;
}

// bits[word][b]: bit i says that Gaussian 32 word + i of the chunk's `count` reaches block b.
inline void list_by_block(Chunk *chunk, const int count, uint bits[CHUNK_WORDS][BLOCKS]) {
  for (int i = (count + 15) & ~15; i < CHUNK; ++i) chunk->blocks[i] = 0;
  for (int word = 0; word < CHUNK_WORDS; ++word)
    vstore16(transpose_bits(chunk->blocks + 32 * word), 0, bits[word]);
}

// Whether a lane of v >= 0 is not 0, as T of a block with unfinished pixels. Spelled so that the
// compiler sees one test of the whole register: `any` is taken apart lane by lane.
inline int any_lane(const float16 v) {
  const int16 bits = as_int16(v);
  const int8 a = bits.lo | bits.hi;
  const int4 b = a.lo | a.hi;
  const int2 c = b.lo | b.hi;
  return (c.x | c.y) != 0;
}

// The weight of a block's next Gaussian, 0 where it is not drawn. T is 0 once a pixel is finished.
inline float16 next_weight(float16 *T, const float8 r, const float16 px, const float16 py) {
  const float16 alpha = alpha_block(log2_alpha_block(r, RECORD_X(r) - px, RECORD_Y(r) - py));
  const float16 after = fma(-alpha, *T, *T);
  const int16 drawn = after >= TRANSMITTANCE_MIN;
  const float16 weight = drawn ? alpha * *T : (float16)(0.0f);
  *T = drawn ? after : (float16)(0.0f);
  return weight;
}
