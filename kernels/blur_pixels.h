// Vectors of the blur: neighbouring pixels of a row, as many as the device's lanes hold.
#ifndef DPR_BLUR_PIXELS_H
#define DPR_BLUR_PIXELS_H

#ifndef DPR_LANES
#define DPR_LANES 8 /* the device's width; the host chooses it */
#endif

/// Neighbours of a row in one vector.
#if DPR_LANES == 16
#define DPR_BLUR_PIXELS 4
typedef float16 pixels_n;
#define load_pixels(pointer) vload16(0, (global const float*)(pointer))
#define store_pixels(value, pointer) vstore16(value, 0, (global float*)(pointer))
#define store_lanes(value, lanes) vstore16(value, 0, (float*)(lanes))
#define join_lines(lines, k) ((float16)((lines)[0][k], (lines)[1][k], (lines)[2][k], (lines)[3][k]))
#elif DPR_LANES == 8
#define DPR_BLUR_PIXELS 2
typedef float8 pixels_n;
#define load_pixels(pointer) vload8(0, (global const float*)(pointer))
#define store_pixels(value, pointer) vstore8(value, 0, (global float*)(pointer))
#define store_lanes(value, lanes) vstore8(value, 0, (float*)(lanes))
#define join_lines(lines, k) ((float8)((lines)[0][k], (lines)[1][k]))
#else
#define DPR_BLUR_PIXELS 1
typedef float4 pixels_n;
#define load_pixels(pointer) (*(pointer))
#define store_pixels(value, pointer) (*(pointer) = (value))
#define store_lanes(value, lanes) ((lanes)[0] = (value))
#define join_lines(lines, k) ((lines)[0][k])
#endif

#endif
