// Which 16x16 tiles a record reaches: for each row of tiles, the columns under the widest chord of
// the ellipse alpha >= ALPHA_MIN (the bounds of Speedy-Splat's AccuTile, Hanson et al. 2025).
// Eight rows of tiles at once. Compile-time: TILE, LOG2_ALPHA_MIN, CHORD_SLACK.
#include "blending.cl"
#line 7 "tiles.cl"

#define SPAN_ROWS 8
#define ROW_LANES ((float8)(0, 1, 2, 3, 4, 5, 6, 7))

typedef struct {
  Ellipse_rows ellipse;
  int first, end;  // rows of tiles
  int columns;     // tiles across the image
} TileRows;

TileRows tile_rows(const float8 r, const int2 size) {
  TileRows rows;
  const Ellipse_pixel e = ellipse_pixel(RECORD_X(r), RECORD_Y(r), -RECORD_A(r),
                                        -0.5f * RECORD_B(r), -RECORD_C(r),
                                        RECORD_L(r) - LOG2_ALPHA_MIN, RECORD_DET(r));
  const Ellipse_rows wide = {(float8)(e.x), (float8)(e.y), (float8)(e.b), (float8)(e.ta),
                             (float8)(e.det), (float8)(e.inverse_a), (float8)(e.y_max),
                             (float8)(e.y_side)};
  rows.ellipse = wide;
  rows.columns = (size.x + TILE - 1) / TILE;
  // Row k has its pixel centres at TILE k + 0.5 .. TILE k + TILE - 0.5.
  const float reach = e.y_max + CHORD_SLACK;
  rows.first = (int)(max(e.y - reach - (TILE - 0.5f), 0.0f) * (1.0f / TILE) + 0.999f);
  const float last = min((e.y + reach - 0.5f) * (1.0f / TILE), (float)((size.y - 1) / TILE));
  rows.end = last >= 0.0f ? (int)last + 1 : 0;
  return rows;
}

// Columns begin[k] .. end[k] of tiles reached in row `row + k`, for 8 rows; begin = end: none.
inline void tile_spans(const TileRows *rows, const int row, int8 *begin, int8 *end) {
  float8 left, right;
  const float8 y = ((float)row + ROW_LANES) * TILE;
  const float8 found = chord_rows(rows->ellipse, y + 0.5f, y + (TILE - 0.5f), &left, &right);
  // Rounding up and down by truncation, which never loses a tile.
  const int8 first = convert_int8(max(left - (TILE - 0.5f), 0.0f) * (1.0f / TILE) + 0.999f);
  const int8 last =
      convert_int8(min((right - 0.5f) * (1.0f / TILE), (float8)(rows->columns - 1.0f)));
  const int8 some = found >= 0.0f && right >= 0.5f && first <= last &&
                    row + ROW_LANES < (float)rows->end;
  *begin = some ? first : (int8)(0);
  *end = some ? last + 1 : (int8)(0);
}

int count_tiles(const float8 record, const int2 size) {
  const TileRows rows = tile_rows(record, size);
  int count = 0;
  for (int row = rows.first; row < rows.end; row += SPAN_ROWS) {
    int8 begin, end;
    tile_spans(&rows, row, &begin, &end);
    const int8 n = end - begin;
    const int4 n4 = n.lo + n.hi;
    count += n4.x + n4.y + n4.z + n4.w;
  }
  return count;
}
