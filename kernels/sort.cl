// Stable counting sort, and tile lists from it: the order (tile, depth, index) on the device.
//
// Items are cut into PARTS contiguous parts, one work-item each, so each step reads and writes in
// the items' order and the result is the one stable order for any PARTS. A table [PARTS, bins] of
// counts turns into first positions by scan_table.
// Compile-time: PARTS; DIGIT_BITS of a radix pass; those of tiles.cl.
#include "tiles.cl"
#line 9 "sort.cl"

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

// Slots are handed out in depth order: Gaussian g owns offsets[g] .. offsets[g] + tile_counts[g].
__kernel void list_tiles(const int n, const int tiles, const int2 size, __global const int *order,
                         __global const int *tile_counts, __global const ulong *part_pairs,
                         __global const float *records, __global int *offsets,
                         __global int *slot_tiles, __global int *table) {
  const int part = get_global_id(0);
  const int2 range = part_range(n, part);
  __global int *counts = table + (size_t)part * tiles;
  for (int k = 0; k < tiles; ++k) counts[k] = 0;
  int slot = 0;
  for (int k = 0; k < part; ++k) slot += (int)part_pairs[k];
  for (int i = range.x; i < range.y; ++i) {
    const int g = order[i];
    offsets[g] = slot;
    if (tile_counts[g] == 0) continue;
    const TileRows rows = tile_rows(vload8(g, records), size);
    for (int row = rows.first; row < rows.end; ++row) {
      const int2 span = tile_span(&rows, row);
      for (int column = span.x; column < span.y; ++column) {
        const int tile = row * rows.columns + column;
        slot_tiles[slot++] = tile;
        ++counts[tile];
      }
    }
  }
}

// ranges[tile] = first and end position; run between scan_table and move_to_tiles.
__kernel void find_ranges(const int tiles, const int pairs, __global const int *table,
                          __global int2 *ranges) {
  const int tile = get_global_id(0);
  if (tile >= tiles) return;
  ranges[tile] = (int2)(table[tile], tile + 1 < tiles ? table[tile + 1] : pairs);
}

__kernel void move_to_tiles(const int n, const int tiles, __global const int *order,
                            __global const int *tile_counts, __global const int *offsets,
                            __global const int *slot_tiles, __global int *table,
                            __global int *sorted_ids, __global int *slot_positions) {
  const int part = get_global_id(0);
  const int2 range = part_range(n, part);
  __global int *next = table + (size_t)part * tiles;
  for (int i = range.x; i < range.y; ++i) {
    const int g = order[i], begin = offsets[g], end = begin + tile_counts[g];
    for (int slot = begin; slot < end; ++slot) {
      const int to = next[slot_tiles[slot]]++;
      sorted_ids[to] = g;
      slot_positions[slot] = to;
    }
  }
}
