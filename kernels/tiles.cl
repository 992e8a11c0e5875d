// Which 16x16 tiles a record reaches: for each row of tiles, the columns under the widest chord of
// the ellipse alpha >= ALPHA_MIN (the bounds of Speedy-Splat's AccuTile, Hanson et al. 2025).
// Compile-time: TILE, LOG2_ALPHA_MIN, CHORD_SLACK.
#include "blending.cl"
#line 6 "tiles.cl"

typedef struct {
  Ellipse_pixel ellipse;
  int first, end;  // rows of tiles
  int columns;     // tiles across the image
} TileRows;

TileRows tile_rows(const float8 r, const int2 size) {
  TileRows rows;
  rows.ellipse = ellipse_pixel(RECORD_X(r), RECORD_Y(r), -RECORD_A(r), -0.5f * RECORD_B(r),
                               -RECORD_C(r), RECORD_L(r) - LOG2_ALPHA_MIN, RECORD_DET(r));
  const float reach = rows.ellipse.y_max + CHORD_SLACK, y = RECORD_Y(r);
  rows.columns = (size.x + TILE - 1) / TILE;
  // Row k has its pixel centres at TILE k + 0.5 .. TILE k + TILE - 0.5.
  rows.first = (int)ceil(fmax(y - reach - (TILE - 0.5f), 0.0f) / TILE);
  rows.end = (int)floor(fmin((y + reach - 0.5f) / TILE, (size.y - 1) / TILE)) + 1;
  return rows;
}

// Columns [x, y) of tiles reached in a row of tiles; empty where none is.
int2 tile_span(const TileRows *rows, const int row) {
  float left, right;
  const float found = chord_pixel(rows->ellipse, row * TILE + 0.5f,
                                  row * TILE + TILE - 0.5f, &left, &right);
  const int first = (int)ceil(fmax(left - (TILE - 0.5f), 0.0f) / TILE);
  const int end = (int)floor(fmin((right - 0.5f) / TILE, rows->columns - 1.0f)) + 1;
  return found >= 0.0f && first < end ? (int2)(first, end) : (int2)(0, 0);
}
