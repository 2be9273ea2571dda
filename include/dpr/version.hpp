// The library's version, which CMake reads here; for the preprocessor alone, of C as well.
#pragma once

#define DPR_VERSION "0.3.0"
