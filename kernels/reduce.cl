// Sums in a fixed order, so that the same numbers give the same bits on any number of threads.
#line 3 "reduce.cl"

// sums [columns] = Σ over rows of partials [rows, columns]; one work-item per column. Kahan's
// correction keeps the result exact to float precision for millions of rows.
__kernel void sum_columns(__global const float *partials, const int rows, const int columns,
                          __global float *sums) {
  const int column = get_global_id(0);
  float total = 0.0f, lost = 0.0f;
  for (int row = 0; row < rows; ++row) {
    const float term = partials[(size_t)row * columns + column] - lost;
    const float next = total + term;
    lost = (next - total) - term;
    total = next;
  }
  sums[column] = total;
}
