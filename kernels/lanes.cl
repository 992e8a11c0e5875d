// F: the Gaussians that one work-item handles at once, 16 on CPUs (LANES = 16), one on GPUs.
//
// Code on F is written once: comparisons select, nothing branches. Beyond the last Gaussian, loads
// repeat it and stores do nothing. A V3 is a 3-vector of F.
#ifndef LUX_LANES_CL
#define LUX_LANES_CL
#include "blending.cl"
#line 9 "lanes.cl"

#ifndef LANES
#define LANES 16
#endif

#if LANES == 16
typedef float16 F;
typedef int16 I;
#define exp2_f exp2_block
#define as_bits as_int16

inline F load_field(__global const float *in, const int first, const int n, const int stride,
                    const int field) {
  float lanes[LANES];
  for (int l = 0; l < LANES; ++l) lanes[l] = in[(size_t)min(first + l, n - 1) * stride + field];
  return vload16(0, lanes);
}
inline void store_field(const F value, __global float *out, const int first, const int n,
                        const int stride, const int field) {
  float lanes[LANES];
  vstore16(value, 0, lanes);
  const int count = min(LANES, n - first);
  for (int l = 0; l < count; ++l) out[(size_t)(first + l) * stride + field] = lanes[l];
}
#else
typedef float F;
typedef int I;
#define exp2_f exp2_pixel
#define as_bits as_int

inline F load_field(__global const float *in, const int first, const int n, const int stride,
                    const int field) {
  return in[(size_t)first * stride + field];
}
inline void store_field(const F value, __global float *out, const int first, const int n,
                        const int stride, const int field) {
  out[(size_t)first * stride + field] = value;
}
#endif

typedef struct {
  F x, y, z;
} V3;

inline F dot3(const V3 a, const V3 b) { return fma(a.x, b.x, fma(a.y, b.y, a.z * b.z)); }
inline V3 scaled(const V3 a, const F k) {
  const V3 r = {a.x * k, a.y * k, a.z * k};
  return r;
}
inline V3 times(const V3 a, const V3 b) {
  const V3 r = {a.x * b.x, a.y * b.y, a.z * b.z};
  return r;
}
inline V3 cross3(const V3 a, const V3 b) {
  const V3 r = {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
  return r;
}
inline V3 weighted(const F j, const V3 a, const F k, const V3 b) {
  const V3 r = {fma(j, a.x, k * b.x), fma(j, a.y, k * b.y), fma(j, a.z, k * b.z)};
  return r;
}
inline V3 load_v3(__global const float *in, const int first, const int n) {
  const V3 r = {load_field(in, first, n, 3, 0), load_field(in, first, n, 3, 1),
                load_field(in, first, n, 3, 2)};
  return r;
}
inline void store_v3(const V3 v, __global float *out, const int first, const int n) {
  store_field(v.x, out, first, n, 3, 0);
  store_field(v.y, out, first, n, 3, 1);
  store_field(v.z, out, first, n, 3, 2);
}

inline F exp_f(const F x) { return exp2_f(fmin(fmax(x * LOG2_E, (F)-125.0f), (F)125.0f)); }

// log2 of a positive normal x, absolute error 1e-7: the exponent, and an atanh series of the rest.
inline F log2_f(const F x) {
  const I shifted = as_bits(x) - 0x3f3504f3;  // mantissa from sqrt(1/2) to sqrt(2)
  const I exponent = shifted >> 23;
#if LANES == 16
  const F m = as_float16((shifted & 0x007fffff) + 0x3f3504f3), e = convert_float16(exponent);
#else
  const F m = as_float((shifted & 0x007fffff) + 0x3f3504f3), e = (float)exponent;
#endif
  const F u = (m - 1.0f) / (m + 1.0f), v = u * u;
  F s = fma(v, (F)(2.0f / 9.0f), (F)(2.0f / 7.0f));
  s = fma(s, v, (F)(2.0f / 5.0f));
  s = fma(s, v, (F)(2.0f / 3.0f));
  s = fma(s, v, (F)2.0f);
  return fma(s * u, (F)LOG2_E, e);
}

#endif
