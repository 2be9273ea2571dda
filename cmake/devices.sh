#!/usr/bin/env bash
# Tries the kernels on the OpenCL implementations for CPUs, in several widths of their vectors, and on NVIDIA's GPUs: tests,
# self-test and two rows of the benchmark. Writes build/devices/ROW/..., then bench/results/devices.csv, and prints the same
# as a table.
#
#   cmake/devices.sh [ROW...]     IMPLEMENTATION-LANES, as below; all if left out
#
# Needs the release build. An implementation that is missing is left out with a note:
#   pocl      Debian's pocl-opencl-icd
#   intel     a virtual environment, named by DPR_INTEL, with pip install intel-opencl-rt intel-cmplr-lib-rt
#   rusticl   Mesa's OpenCL: apt-get install mesa-opencl-icd, which cannot be installed beside the libclc-19 of the
#             tests; DPR_RUSTICL names a folder with libRusticlOpenCL.so.1 elsewhere
#   nvidia    the GPU's driver; DPR_NVIDIA names a folder with libnvidia-opencl.so.1 that the linker does not know
#
# The tests are those of the kernels: tests/stages, and the pipeline against the reference. Tests of files and commands
# say nothing of a device. rusticl's compiler takes minutes for the kernels of a frame, and half an hour for all tests.
# Under oclgrind, a simulator, all tests run: cmake/test.sh oclgrind.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

bin=$PWD/build/release/bin
out=$PWD/build/devices
icds=$out/icd
sources="*/stages/*,*/reference_render_test.cpp,*/pixel_noise_reference_test.cpp"
test_limit=7200 # seconds for the tests of a row

# The libraries, each in a folder of its own that the ICD loader is pointed to.
intel=${DPR_INTEL:-}/lib/libintelocl.so
rusticl=${DPR_RUSTICL:-/usr/lib/$(uname -m)-linux-gnu}/libRusticlOpenCL.so.1
nvidia=libnvidia-opencl.so.1
known=$(PATH=$PATH:/usr/sbin:/sbin ldconfig -p | sed -n "/$nvidia (libc6,/{s/.* => //p;q}")
libraries=/usr/lib/$(uname -m)-linux-gnu
for file in "${DPR_NVIDIA:-}/$nvidia" "$known" {/usr/local/nvidia/lib64,"$libraries","$libraries/nvidia/current",/usr/lib64}/"$nvidia"; do
  if [[ -e $file ]]; then
    nvidia=$file
    break
  fi
done
mkdir -p "$icds"/{pocl,intel,rusticl,nvidia}
if [[ -e /etc/OpenCL/vendors/pocl.icd ]]; then cp /etc/OpenCL/vendors/pocl.icd "$icds/pocl/"; fi
echo "$intel" >"$icds/intel/intel.icd"
echo "$rusticl" >"$icds/rusticl/rusticl.icd"
echo "$nvidia" >"$icds/nvidia/nvidia.icd"

# on ROW COMMAND...: runs it with the row's implementation, and in its width.
on() {
  local row=$1
  shift
  local environment=("DPR_LANES=${row##*-}")
  case ${row%-*} in
    pocl) environment+=("OCL_ICD_VENDORS=$icds/pocl/") ;;
    intel) environment+=("OCL_ICD_VENDORS=$icds/intel/" "LD_LIBRARY_PATH=$(dirname "$intel")") ;;
    rusticl)
      environment+=("OCL_ICD_VENDORS=$icds/rusticl/" "LD_LIBRARY_PATH=$(dirname "$rusticl")" RUSTICL_ENABLE=llvmpipe)
      ;;
    nvidia) environment+=("OCL_ICD_VENDORS=$icds/nvidia/" "LD_LIBRARY_PATH=$(dirname "$nvidia")${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}") ;;
  esac
  env "${environment[@]}" "$@"
}

is_there() {
  case ${1%-*} in
    pocl) [[ -e /etc/OpenCL/vendors/pocl.icd ]] ;;
    intel) [[ -e $intel ]] ;;
    rusticl) [[ -e $rusticl ]] ;;
    nvidia) [[ -e $nvidia ]] ;;
    *) false ;;
  esac
}

rows=("$@")
if ((${#rows[@]} == 0)); then rows=(pocl-1 pocl-8 pocl-16 intel-1 intel-16 rusticl-1 rusticl-8 nvidia-1); fi
for row in "${rows[@]}"; do
  if ! is_there "$row"; then
    echo "$row: not here (see the head of $0)"
    continue
  fi
  echo "== $row"
  rm -rf "${out:?}/$row"
  mkdir -p "$out/$row"
  on "$row" "$bin/dpr" devices --json --check >"$out/$row/check.json" || echo "$row: the self-test failed"
  if [[ $(<"$out/$row/check.json") == "[]" ]]; then
    echo "$row: has no device here"
    rm -r "${out:?}/$row"
    continue
  fi
  on "$row" timeout "$test_limit" "$bin/dpr_tests" --source-file="$sources" --reporters=junit \
    >"$out/$row/tests.xml" 2>"$out/$row/tests.log" || echo "$row: tests failed"
  on "$row" "$bin/dpr-bench" --workload sphere256 --workload cube128 --quiet -o "$out/$row/bench.json" ||
    echo "$row: the benchmark failed"
done
python3 bench/report/device_table.py "$out" bench/results/devices.csv
