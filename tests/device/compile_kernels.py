#!/usr/bin/env python3
"""Compiles every kernel with every set of options that a stage builds it with, at 1, 8 and 16 lanes.

compile_kernels.py lint CLANG KERNELS [MORE...]            as strict OpenCL C 1.2; warnings are errors, and so are
                                                           kernels of more than 14 arguments
compile_kernels.py driver KERNELS [MORE...] [--lanes N...] to machine code, by the driver of the first OpenCL device

KERNELS is the folder with the headers, MORE other folders or files: with files the folder's own are left out.

A compilation is a process of its own, so that a driver that aborts fails with its last words and the others are tried.
"""
import argparse
import concurrent.futures
import ctypes
import itertools
import os
import pathlib
import re
import subprocess
import sys

LANES = [1, 8, 16]
MOST_ARGUMENTS = 14
# Unlit surfaces are shade.cl's. One kind of light a time, none, and all.
SHADING = [[f"-DDPR_SHADING={shading}", f"-DDPR_LIGHTS={lights}", f"-DDPR_BASE={base}"]
           for shading, lights, base in itertools.product([1, 2, 3, 4, 5], [0, 1, 2, 4, 7], ["DPR_BASE_OF_CORNERS", "DPR_BASE_OF_FRAGMENTS"])]


def priors(kernels):
    """Names of all priors, and of those that can be sampled: they have a score."""
    texts = {file.stem.removeprefix("prior_"): file.read_text() for file in sorted(kernels.glob("prior_*.h"))}
    return list(texts), [name for name, text in texts.items() if f"{name}_score(" in text]


def option_sets(kernels):
    """By file, lists of options beside the lanes; a file that is not there has one, which is empty."""
    exact, sampled = priors(kernels)
    of_exact, of_sampled = ([f"-DDPR_PRIOR={name}" for name in names] for names in (exact, sampled))
    joint = [[f"-DDPR_OCCUPANCY_PRIOR={occupancy}", f"-DDPR_DEPTH_PRIOR={depth}"] for occupancy in sampled for depth in sampled]
    fits = [[f"-DDPR_TERMS={terms}", f"-DDPR_DIRECTIONS={directions}"] for terms in [0, 2, 10] for directions in [3, 6, 9]]
    measured = [[*fit, "-DDPR_MEASURED=1"] for fit in fits]
    return {"aggregate.cl": [[prior] for prior in of_exact], "aggregate_joint.cl": [[prior] for prior in of_exact],
            "aggregate_sampled.cl": [[prior] for prior in of_sampled], "aggregate_joint_sampled.cl": joint,
            "normal_equations.cl": fits + measured, "normal_measured.cl": measured, "occupancy.cl": [[prior] for prior in of_exact],
            "occupancy_sampled.cl": [[prior] for prior in of_sampled], "shade_lit.cl": SHADING,
            "shade_lit_tangent.cl": SHADING, "transform.cl": [[], ["-cl-fp32-correctly-rounded-divide-sqrt"]]}


def compilations(folders, lanes):
    """Every (file, options)."""
    sets = option_sets(folders[0])
    files = [path for path in folders if path.is_file()] or [file for folder in folders for file in sorted(folder.glob("*.cl"))]
    for file in files:
        for count, options in itertools.product(lanes, sets.get(file.name, [[]])):
            yield file, [f"-I{folders[0]}", f"-DDPR_LANES={count}", *options]


def check(opencl, function, *arguments):
    if error := getattr(opencl, function)(*arguments):
        sys.exit(f"{function}: error {error}")


def build_with_driver(file, options):
    """Asks for the binary, without which PoCL compiles a kernel at its first launch."""
    opencl = ctypes.CDLL("libOpenCL.so.1")
    opencl.clCreateContext.restype = opencl.clCreateProgramWithSource.restype = ctypes.c_void_p
    platform, device, size = ctypes.c_void_p(), ctypes.c_void_p(), ctypes.c_size_t()
    check(opencl, "clGetPlatformIDs", 1, ctypes.byref(platform), None)
    check(opencl, "clGetDeviceIDs", platform, ctypes.c_uint64(0xFFFFFFFF), 1, ctypes.byref(device), None)
    context = ctypes.c_void_p(opencl.clCreateContext(None, 1, ctypes.byref(device), None, None, None))
    text = ctypes.c_char_p(pathlib.Path(file).read_bytes())
    program = ctypes.c_void_p(opencl.clCreateProgramWithSource(context, 1, ctypes.byref(text), None, None))
    words = " ".join(["-cl-std=CL1.2 -cl-kernel-arg-info -w", *options]).encode()
    if error := opencl.clBuildProgram(program, 1, ctypes.byref(device), words, None, None):
        log = ctypes.create_string_buffer(1 << 16)
        opencl.clGetProgramBuildInfo(program, device, 0x1183, ctypes.c_size_t(len(log)), log, None)  # CL_PROGRAM_BUILD_LOG
        sys.exit(f"clBuildProgram: error {error}\n{log.value.decode()}")
    binary_sizes = 0x1165  # CL_PROGRAM_BINARY_SIZES
    check(opencl, "clGetProgramInfo", program, binary_sizes, ctypes.c_size_t(8), ctypes.byref(size), None)
    if size.value == 0:
        sys.exit("no binary")


def long_lists(files):
    """Kernels of more arguments than are allowed."""
    for file in files:
        for name, arguments in re.findall(r"\bkernel void (\w+)\(([^)]*)\)", file.read_text()):
            count = arguments.count(",") + 1
            if count > MOST_ARGUMENTS:
                yield f"{file.name}: {name} has {count} arguments, more than {MOST_ARGUMENTS}\n"


def lint_command(clang):
    return [clang, "-x", "cl", "-cl-std=CL1.2", "-Xclang", "-finclude-default-header", "-fsyntax-only",
            "-Wall", "-Wextra", "-Wdouble-promotion", "-Werror"]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("compiler", choices=["lint", "driver", "build"])
    parser.add_argument("words", nargs="+")
    parser.add_argument("--lanes", type=int, nargs="*", default=LANES)
    arguments, options = parser.parse_known_args()
    words = arguments.words
    if arguments.compiler == "build":
        return build_with_driver(words[0], options)
    command = [sys.executable, __file__, "build"]
    if arguments.compiler == "lint":
        command = lint_command(words.pop(0))
        if lists := list(long_lists(file for folder in words for file in sorted(pathlib.Path(folder).glob("*.cl")))):
            sys.exit("".join(lists))
        if not pathlib.Path(command[0]).exists():
            return print("skipped: no clang")

    def failure(compilation):
        file, options = compilation
        run = subprocess.run([*command, str(file), *options], capture_output=True, text=True)
        return f"{file.name} {' '.join(options[1:])}\n{run.stdout}{run.stderr}" if run.returncode != 0 else ""

    todo = list(compilations([pathlib.Path(word) for word in words], arguments.lanes))
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        failures = [text for text in pool.map(failure, todo) if text]
    if failures or not todo:
        sys.exit("".join(failures) + f"{len(todo)} compilations, {len(failures)} failed")
    print(f"{len(todo)} compilations")


if __name__ == "__main__":
    sys.exit(main())
