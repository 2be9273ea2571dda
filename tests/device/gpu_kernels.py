#!/usr/bin/env python3
"""What the kernels need of a GPU at one lane, by the compiler's own account; no GPU is needed.

gpu_kernels.py KERNELS TABLE.csv          fails where a kernel needs more than the table says
gpu_kernels.py KERNELS TABLE.csv --write  writes the table anew

Either fails where a kernel does not compile, spills registers, has scratch memory on AMD, or more than 128 registers.

Debian's clang-19 with libclc-19 compiles for AMD's gfx1030 (RDNA 2) and to NVIDIA's PTX; where CUDA is installed, ptxas compiles
that for an H100. Occupancy is in wavefronts of the 16 that a SIMD holds.
"""
import csv
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

CLANG = ["clang-19", "-x", "cl", "-cl-std=CL1.2", "-Xclang", "-finclude-default-header", "-O3", "-DDPR_LANES=1", "-Wno-linker-warnings",
         "-S"]
LIBRARY = pathlib.Path("/usr/lib/clc")
AMD = ["-target", "amdgcn-mesa-mesa3d", "-mcpu=gfx1030"]
NVIDIA = ["-target", "nvptx64-nvidia-nvcl", "-march=sm_90"]
AMD_BUILTINS = "gfx1030-amdgcn-mesa-mesa3d.bc"
NVIDIA_BUILTINS = "nvptx64--nvidiacl.bc"
LIMITS = {"amd_vgprs": 128, "amd_scratch_bytes": 0, "nvidia_registers": 128}
KEYS = ["amd_vgprs", "amd_sgprs", "amd_scratch_bytes", "amd_local_bytes", "amd_occupancy", "nvidia_registers", "nvidia_stack_bytes"]


def compile_to(output, source, target, library):
    options = [*target, "-I", str(source.parent), "-Xclang", "-mlink-builtin-bitcode", "-Xclang", str(LIBRARY / library)]
    subprocess.run([*CLANG, *options, "-o", str(output), str(source)], check=True)
    return output.read_text()


def amd_needs(assembly):
    """By kernel, from the comments that end each function."""
    needs = {}
    for name, comments in re.findall(r"\.amdgpu_hsa_kernel (\w+)\n.*?; Kernel info:\n(.*?)\n\t\.", assembly, re.DOTALL):
        def value(key):
            return int(re.search(rf"; {key}: (\d+)", comments)[1])
        needs[name] = {"amd_vgprs": value("NumVgprs"), "amd_sgprs": value("NumSgprs"), "amd_scratch_bytes": value("ScratchSize"),
                       "amd_local_bytes": value("LDSByteSize"), "amd_occupancy": value("Occupancy")}
    return needs


def nvidia_needs(ptx, folder):
    """By kernel, from what ptxas says. Raises where it spills."""
    report = subprocess.run([shutil.which("ptxas") or "/usr/local/cuda/bin/ptxas", "-v", "-arch=sm_90", str(ptx), "-o", str(folder / "cubin")],
                            check=True, capture_output=True, text=True).stderr
    needs = {}
    for name, stack, stores, loads, registers in re.findall(
            r"Compiling entry function '(\w+)'.*?(\d+) bytes stack frame, (\d+) bytes spill stores, (\d+) bytes spill loads.*?"
            r"Used (\d+) registers", report, re.DOTALL):
        if int(stores) or int(loads):
            sys.exit(f"{name}: spills {stores} bytes of registers")
        needs[name] = {"nvidia_registers": int(registers), "nvidia_stack_bytes": int(stack)}
    return needs


def has_ptxas():
    return shutil.which("ptxas") or pathlib.Path("/usr/local/cuda/bin/ptxas").exists()


def measure(kernels):
    rows = {}
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for source in sorted(kernels.glob("*.cl")):
            if "kernel void" not in source.read_text():
                continue  # it joins others
            needs = amd_needs(compile_to(folder / "amd.s", source, AMD, AMD_BUILTINS))
            compile_to(folder / "nvidia.ptx", source, NVIDIA, NVIDIA_BUILTINS)
            if has_ptxas():
                for kernel, values in nvidia_needs(folder / "nvidia.ptx", folder).items():
                    needs[kernel].update(values)
            for kernel, values in needs.items():
                rows[source.name, kernel] = values
    return rows


def read(table):
    with open(table, newline="") as file:
        return {(row["file"], row["kernel"]): {key: int(row[key]) for key in KEYS if row[key]} for row in csv.DictReader(file)}


def write(table, rows):
    with open(table, "w", newline="") as file:
        writer = csv.DictWriter(file, ["file", "kernel", *KEYS], lineterminator="\n")
        writer.writeheader()
        for (source, kernel), values in rows.items():
            writer.writerow({"file": source, "kernel": kernel, **values})


def differences(rows, table):
    """What is worse than the table, a line each."""
    for key in rows.keys() ^ table.keys():
        yield f"{' '.join(key)}: only in {'the sources' if key in rows else 'the table'}"
    for key in rows.keys() & table.keys():
        for name, value in rows[key].items():
            known = table[key].get(name, value)
            if value < known if name == "amd_occupancy" else value > known:
                yield f"{' '.join(key)}: {name} {value}, in the table {known}"


def excesses(rows):
    """What is beyond the limits, a line each."""
    for key, values in rows.items():
        for name, limit in LIMITS.items():
            if values.get(name, 0) > limit:
                yield f"{' '.join(key)}: {name} {values[name]}, at most {limit}"


def main():
    # libclc-15, which Mesa's OpenCL needs, takes the place of libclc-19.
    if not shutil.which("clang-19") or not all((LIBRARY / name).exists() for name in (AMD_BUILTINS, NVIDIA_BUILTINS)):
        print("skipped: no clang-19 or libclc-19")
        return
    kernels, table = pathlib.Path(sys.argv[1]), sys.argv[2]
    rows = measure(kernels)
    if beyond := sorted(excesses(rows)):
        sys.exit("\n".join(beyond))
    if "--write" in sys.argv[3:]:
        write(table, rows)
        return
    worse = sorted(differences(rows, read(table)))
    if worse or not rows:
        sys.exit("\n".join([*worse, "Write the table anew with --write if that is meant."]))
    print(f"{len(rows)} kernels need no more than the table says")


if __name__ == "__main__":
    main()
