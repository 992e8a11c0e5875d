// Micro-benchmarks: what this machine can do, to compare the engine with. One work-item per part.
#line 3 "limits.cl"

// 16 independent chains of fused multiply-adds on float16: 512 floating-point operations a turn.
__kernel void fma_chains(const int turns, __global float *out) {
  float16 x[16];
#pragma unroll
  for (int k = 0; k < 16; ++k) x[k] = (float16)(get_global_id(0) + k);
  const float16 a = (float16)(0.999f), b = (float16)(out[0]);
  for (int turn = 0; turn < turns; ++turn) {
#pragma unroll
    for (int k = 0; k < 16; ++k) x[k] = fma(x[k], a, b);
  }
  float16 sum = (float16)(0.0f);
#pragma unroll
  for (int k = 0; k < 16; ++k) sum += x[k];
  vstore16(sum, get_global_id(0), out);
}

// Reads `vectors` float16s per work-item.
__kernel void read_memory(const int vectors, __global const float *in, __global float *out) {
  const size_t first = (size_t)get_global_id(0) * vectors;
  float16 a = (float16)(0.0f), b = a, c = a, d = a;
  for (int i = 0; i < vectors; i += 4) {
    a += vload16(first + i, in);
    b += vload16(first + i + 1, in);
    c += vload16(first + i + 2, in);
    d += vload16(first + i + 3, in);
  }
  vstore16(a + b + c + d, get_global_id(0), out);
}
