// Shared by every splat kernel: constants, precision and small mathematics.
//
// All constants arrive from luxcore/splats/rasterizer/constants.py as -D, so that host, kernels and
// torch twins use one value. The defaults below only let a file compile on its own.
// Precision: fp32, OpenCL C 1.2. Quaternions are w-x-y-z; camera axes are OpenCV's.
#ifndef LUX_COMMON_CL
#define LUX_COMMON_CL
#line 9 "common.cl"

#ifndef TILE
#define TILE 16
#endif
#ifndef ALPHA_MIN
#define ALPHA_MIN (1.0f / 255.0f)
#endif
#ifndef LOG2_ALPHA_MIN
#define LOG2_ALPHA_MIN -7.994353437f
#endif
#ifndef CHORD_SLACK
#define CHORD_SLACK 0.01f
#endif
#ifndef ALPHA_MAX
#define ALPHA_MAX 0.99f
#endif
#ifndef TRANSMITTANCE_MIN
#define TRANSMITTANCE_MIN 1e-4f
#endif
#ifndef CHANNELS
#define CHANNELS 3
#endif
#ifndef NEAR_M
#define NEAR_M 0.01f
#endif
#ifndef EPS2D
#define EPS2D 0.3f
#endif
#ifndef ANTIALIASED
#define ANTIALIASED 0
#endif
#ifndef COMPENSATION_MIN
#define COMPENSATION_MIN 0.005f
#endif

#endif
