// Stable counting sort, and tile lists from it: the order (tile, depth, index) on the device.
//
// Items are cut into PARTS contiguous parts, one work-item each, so each step reads and writes in
// the items' order and the result is the one stable order for any PARTS. A table [PARTS, bins] of
// counts turns into first positions by scan_table.
// Compile-time: PARTS; DIGIT_BITS of a radix pass; those of tiles.cl.
#include "tiles.cl"
#line 9 "sort.cl"

#define BATCH 32
#define DIGITS (1 << DIGIT_BITS)

int2 part_range(const int n, const int part) {
  const int length = (n + PARTS - 1) / PARTS;
  return (int2)(min(part * length, n), min(part * length + length, n));
}

__kernel void count_digits(const int n, const int shift, __global const uint *keys,
                           __global int *table) {
  const int part = get_global_id(0);
  const int2 range = part_range(n, part);
  __global int *counts = table + part * DIGITS;
  for (int k = 0; k < DIGITS; ++k) counts[k] = 0;
  for (int i = range.x; i < range.y; ++i) ++counts[keys[i] >> shift & (DIGITS - 1)];
}

// Without values_in, the values are 0 .. n - 1.
__kernel void move_by_digit(const int n, const int shift, __global const uint *keys_in,
                            __global const int *values_in, __global int *table,
                            __global uint *keys_out, __global int *values_out) {
  const int part = get_global_id(0);
  const int2 range = part_range(n, part);
  __global int *next = table + part * DIGITS;
  for (int i = range.x; i < range.y; ++i) {
    const uint key = keys_in[i];
    const int to = next[key >> shift & (DIGITS - 1)]++;
    keys_out[to] = key;
    values_out[to] = values_in ? values_in[i] : i;
  }
}

// Exclusive scan in the order (bin, part). One work-group; item k takes every bin of its segment.
__kernel void scan_table(const int bins, __global int *table, __local int *sums) {
  const int item = get_local_id(0), items = get_local_size(0);
  const int length = (bins + items - 1) / items;
  const int begin = min(item * length, bins), end = min(begin + length, bins);
  int sum = 0;
  for (int bin = begin; bin < end; ++bin)
    for (int part = 0; part < PARTS; ++part) sum += table[part * bins + bin];
  sums[item] = sum;
  barrier(CLK_LOCAL_MEM_FENCE);
  int at = 0;
  for (int k = 0; k < item; ++k) at += sums[k];
  for (int bin = begin; bin < end; ++bin)
    for (int part = 0; part < PARTS; ++part) {
      const int count = table[part * bins + bin];
      table[part * bins + bin] = at;
      at += count;
    }
}

// Pairs (Gaussian, tile) of each part of the depth order; 64-bit, as a scene may hold too many.
__kernel void count_pairs(const int n, __global const int *order, __global const int *tile_counts,
                          __global ulong *part_pairs) {
  const int part = get_global_id(0);
  const int2 range = part_range(n, part);
  ulong sum = 0;
  for (int i = range.x; i < range.y; ++i) sum += tile_counts[order[i]];
  part_pairs[part] = sum;
}

typedef struct {
  int first, rows;                  // rows of tiles
  int begin[SPAN_ROWS], end[SPAN_ROWS];  // columns of the first SPAN_ROWS of them
} Spans;

inline void spans_from(Spans *spans, const float8 record, const int2 size, const int skipped) {
  const TileRows rows = tile_rows(record, size);
  int8 begin, end;
  tile_spans(&rows, rows.first + skipped, &begin, &end);
  vstore8(begin, 0, spans->begin);
  vstore8(end, 0, spans->end);
  spans->first = rows.first + skipped;
  spans->rows = rows.end - rows.first - skipped;
}

// Slots are handed out in depth order: order[i] owns offsets[i] .. offsets[i + 1].
// A batch is first fetched, then measured, then listed: records lie far apart, and only a loop that
// does nothing but fetch keeps many of them on the way.
__kernel void list_tiles(const int n, const int tiles, const int2 size, __global const int *order,
                         __global const int *tile_counts, __global const ulong *part_pairs,
                         __global const float *records, __global int *offsets,
                         __global int *slot_tiles, __global int *table) {
  const int part = get_global_id(0), columns = (size.x + TILE - 1) / TILE;
  const int2 range = part_range(n, part);
  __global int *counts = table + (size_t)part * tiles;
  for (int k = 0; k < tiles; ++k) counts[k] = 0;
  int slot = 0;
  for (int k = 0; k < part; ++k) slot += (int)part_pairs[k];
  if (part == 0) offsets[n] = 0;  // for n = 0
  Spans batch[BATCH];
  float8 fetched[BATCH];
  for (int base = range.x; base < range.y; base += BATCH) {
    const int count = min(BATCH, range.y - base);
    for (int j = 0; j < count; ++j) fetched[j] = vload8(order[base + j], records);
    for (int j = 0; j < count; ++j) {
      spans_from(&batch[j], fetched[j], size, 0);
      if (tile_counts[order[base + j]] == 0) batch[j].rows = 0;
    }
    for (int j = 0; j < count; ++j) {
      offsets[base + j] = slot;
      Spans *spans = &batch[j];
      for (int done = 0; spans->rows > 0;) {
        for (int k = 0; k < min(SPAN_ROWS, spans->rows); ++k)
          for (int column = spans->begin[k]; column < spans->end[k]; ++column) {
            const int tile = (spans->first + k) * columns + column;
            slot_tiles[slot++] = tile;
            ++counts[tile];
          }
        if (spans->rows <= SPAN_ROWS) break;
        done += SPAN_ROWS;
        spans_from(spans, fetched[j], size, done);
      }
    }
  }
  if (range.y == n) offsets[n] = slot;
}

// ranges[tile] = first and end position; run between scan_table and move_to_tiles.
__kernel void find_ranges(const int tiles, const int pairs, __global const int *table,
                          __global int2 *ranges) {
  const int tile = get_global_id(0);
  if (tile >= tiles) return;
  ranges[tile] = (int2)(table[tile], tile + 1 < tiles ? table[tile + 1] : pairs);
}

__kernel void move_to_tiles(const int n, const int tiles, __global const int *order,
                            __global const int *offsets, __global const int *slot_tiles,
                            __global int *table, __global int *sorted_ids,
                            __global int *slot_positions) {
  const int part = get_global_id(0);
  const int2 range = part_range(n, part);
  __global int *next = table + (size_t)part * tiles;
  for (int i = range.x; i < range.y; ++i) {
    const int g = order[i], end = offsets[i + 1];
    for (int slot = offsets[i]; slot < end; ++slot) {
      const int to = next[slot_tiles[slot]]++;
      sorted_ids[to] = g;
      slot_positions[slot] = to;
    }
  }
}
