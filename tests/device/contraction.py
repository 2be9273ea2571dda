#!/usr/bin/env python3
"""Checks that no compiler for GPUs may fuse products and sums of functions whose results are exact; no GPU is needed.

contraction.py KERNELS

Debian's clang-19 compiles every kernel with contraction across statements wherever no pragma forbids it, as drivers do. The test
fails where unoptimized code of these functions has an addition or a product that may be fused, where no kernel has one of the
functions, and where the optimized predicate of a product has more fused operations than the source.
"""
import pathlib
import re
import shutil
import subprocess
import sys

CLANG = ["clang-19", "-x", "cl", "-cl-std=CL1.2", "-Xclang", "-finclude-default-header", "-DDPR_LANES=1", "-w", "-ffp-contract=fast-honor-pragmas", "-S",
         "-o", "-"]
AMD = ["-target", "amdgcn-mesa-mesa3d", "-mcpu=gfx1030"]
NVIDIA = ["-target", "nvptx64-nvidia-nvcl"]
EXACT = {"two_sum", "exact_side", "side_of_line", "pixel_centre", "pixel_x", "pixel_y", "cut_ndc", "make_cut", "bend_tangent",
         "compensated_add", "add_channels", "exchange_map"}
MAY_FUSE = re.compile(r" = f(?:add|sub|mul|div)\b[^\n]*\bcontract\b|@llvm\.fmuladd")
PROBE = """
#include "ownership.h"
kernel void probe(global const float2* points, const float size, global int* side) {
  const uint i = (uint)get_global_id(0);
  side[i] = side_of_line(points[3 * i], points[3 * i + 1], points[3 * i + 2] * size);
}
"""
FUSED_IN_SOURCE = 6  # exact_side() has so many products, each with its error by fma()


def compiled(kernels, options, source):
    return subprocess.run([*CLANG, *options, "-I", str(kernels), "-"], input=source, check=True, capture_output=True, text=True).stdout


def functions(code):
    return re.findall(r"^define [^\n]*@(\w+)\([^\n]*\{\n(.*?)^\}", code, re.DOTALL | re.MULTILINE)


def main():
    if not shutil.which("clang-19"):
        print("skipped: no clang-19")
        return
    kernels = pathlib.Path(sys.argv[1])
    wrong, found = set(), set()
    for target in (AMD, NVIDIA):
        for source in sorted(kernels.glob("*.cl")):
            for name, body in functions(compiled(kernels, [*target, "-O0", "-emit-llvm"], source.read_text())):
                if name in EXACT:
                    found.add(name)
                    if fused := MAY_FUSE.search(body):
                        wrong.add(f"{source.name} {name}: may be fused:{fused[0]}")
    wrong |= {f"{name}: in no kernel" for name in EXACT - found}
    fused = len(re.findall(r"\bfma\.rn\.f32\b|call[^;]*?\b_Z3fmafff\b", compiled(kernels, [*NVIDIA, "-O3"], PROBE)))
    if fused != FUSED_IN_SOURCE:
        wrong.add(f"side_of_line: {fused} fused operations, {FUSED_IN_SOURCE} in the source")
    if wrong:
        sys.exit("\n".join(sorted(wrong)))
    print(f"{len(found)} functions, none of them fused")


if __name__ == "__main__":
    main()
