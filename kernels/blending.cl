// The arithmetic of one contribution, once for one pixel (float) and once for 16 (float16).
//
// alpha = min(ALPHA_MAX, 2^p), p = log2(opacity) + log2(e) * (-(a dx^2 + c dy^2) / 2 - b dx dy),
// (Kerbl et al. 2023, eq. 2 and 3). A record holds the conic already multiplied by log2(e) and the
// halves: p = l + a dx^2 + b dx dy + c dy^2. fma is written out so that the forward and backward
// passes, and both mappings, round alike and stop at the same Gaussian.
#include "common.cl"
#line 9 "blending.cl"
#ifndef LUX_BLENDING_CL
#define LUX_BLENDING_CL
#pragma OPENCL FP_CONTRACT OFF

#define LOG2_E 1.4426950408889634f

// record = (mean2d x, mean2d y, a, b, c, l, depth, det of [[a, b/2], [b/2, c]])
#define RECORD_X(r) ((r).s0)
#define RECORD_Y(r) ((r).s1)
#define RECORD_A(r) ((r).s2)
#define RECORD_B(r) ((r).s3)
#define RECORD_C(r) ((r).s4)
#define RECORD_L(r) ((r).s5)
#define RECORD_DEPTH(r) ((r).s6)
#define RECORD_DET(r) ((r).s7)

#define DEFINE_BLENDING(F, I, NAME)                                                               \
  /* log2 of the unclamped alpha */                                                               \
  inline F log2_alpha_##NAME(const float8 r, const F dx, const F dy) {                            \
    return fma(fma((F)RECORD_A(r), dx, RECORD_B(r) * dy), dx,                                     \
               fma(RECORD_C(r) * dy, dy, (F)RECORD_L(r)));                                        \
  }                                                                                               \
  /* 2^p for |p| < 126, relative error 1.2e-7: 2^round(p) by the exponent, the rest a minimax */  \
  /* polynomial of degree 5. */                                                                   \
  inline F exp2_##NAME(const F p) {                                                               \
    const F shifted = p + 12582912.0f; /* 1.5 * 2^23: the integer part lands in the low bits */   \
    const F f = p - (shifted - 12582912.0f);                                                      \
    F s = fma(f, (F)1.327647111e-03f, (F)9.675541327e-03f);                                       \
    s = fma(s, f, (F)5.550713276e-02f);                                                           \
    s = fma(s, f, (F)2.402211972e-01f);                                                           \
    s = fma(s, f, (F)6.931469671e-01f);                                                           \
    s = fma(s, f, (F)1.000000072e+00f);                                                           \
    return as_##F(as_##I(s) + (as_##I(shifted) << 23));                                           \
  }                                                                                               \
  /* alpha, 0 below the cut-off */                                                                \
  inline F alpha_##NAME(const F p) {                                                              \
    return p >= LOG2_ALPHA_MIN ? fmin(exp2_##NAME(p), (F)ALPHA_MAX) : (F)0.0f;                    \
  }

DEFINE_BLENDING(float, int, pixel)
DEFINE_BLENDING(float16, int16, block)

// The ellipse alpha >= ALPHA_MIN of a record, as {a x^2 + 2 b x y + c y^2 <= t} about (x, y). The
// determinant is the record's own: computed here it would cancel for needles.
#define DEFINE_ELLIPSE(F, NAME)                                                                   \
  typedef struct {                                                                                \
    F x, y, b, ta, det, inverse_a;                                                                \
    F y_max;  /* half height */                                                                   \
    F y_side; /* its rightmost point lies at -y_side, its leftmost at y_side */                   \
  } Ellipse_##NAME;                                                                               \
  inline Ellipse_##NAME ellipse_##NAME(const F x, const F y, const F a, const F b, const F c,     \
                                       const F t, const F det) {                                  \
    const F t_over_det = t / det;                                                                 \
    Ellipse_##NAME e = {x, y, b, t * a, det, 1.0f / a, sqrt(t_over_det * a),                      \
                        b * sqrt(t_over_det / c)};                                                \
    return e;                                                                                     \
  }                                                                                               \
  /* left and right ends of the widest chord with top <= y <= bottom; false where there is none */ \
  inline F chord_##NAME(const Ellipse_##NAME e, const F top, const F bottom, F *left, F *right) { \
    const F low = max(top - e.y, -e.y_max), high = min(bottom - e.y, e.y_max);                  \
    const F yr = min(max(-e.y_side, low), high), yl = min(max(e.y_side, low), high);          \
    const F half_r = sqrt(max(fma(-e.det * yr, yr, e.ta), (F)0.0f));                             \
    const F half_l = sqrt(max(fma(-e.det * yl, yl, e.ta), (F)0.0f));                             \
    *right = fma(half_r - e.b * yr, e.inverse_a, e.x) + CHORD_SLACK;                              \
    *left = fma(-half_l - e.b * yl, e.inverse_a, e.x) - CHORD_SLACK;                              \
    return high - low + CHORD_SLACK; /* negative: no chord */                                     \
  }

DEFINE_ELLIPSE(float, pixel)
DEFINE_ELLIPSE(float8, rows)
DEFINE_ELLIPSE(float16, block)

#endif
