#!/usr/bin/env bash
# Makes Python wheels in build/wheels: dpr, the package with its library, for every Python 3; and dpr_pocl, Debian's PoCL
# for machines without an OpenCL driver, with all that it needs. They run where the C library is as new as here.
#
#   cmake/wheel.sh [ARCH]     amd64 or arm64 (Debian's names); this machine's if left out, else by a cross compiler
#
# On Debian 12: dpr_pocl is made of its packages, which are downloaded. Needs, beside what a build needs: dpkg-dev,
# patchelf, python3-wheel; for another ARCH: dpkg --add-architecture ARCH, g++-TRIPLET (with dashes), libopenmesh-dev:ARCH
# and ocl-icd-opencl-dev:ARCH.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
arch=${1:-$(dpkg --print-architecture)}
triplet=$(dpkg-architecture -a "$arch" -q DEB_HOST_MULTIARCH 2>/dev/null)
libc=$(getconf GNU_LIBC_VERSION)
platform=manylinux_$(tr . _ <<<"${libc#* }")_${triplet%%-*}
work=$PWD/build/wheel-$arch
rm -rf "$work/stage" "$work/pocl"
mkdir -p build/wheels

# bundle FOLDER FILE ROOT: copies a program or a library, and the libraries that it needs from the system in ROOT, into the
# folder, where they find each other. Those that every Linux with this C library has stay out.
bundle() {
  local folder=$1 file=$2 root=$3 name library
  install -D "$file" "$folder/$(basename "$file")"
  patchelf --set-rpath "\$ORIGIN" "$folder/$(basename "$file")"
  for name in $(patchelf --print-needed "$file"); do
    if [[ $name =~ ^(ld-linux.*|lib(c|m|dl|rt|pthread|gcc_s|stdc\+\+|z)\.so\.[0-9]+)$ || -e $folder/$name ]]; then continue; fi
    library=$(find "$root/lib/$triplet/" "$root/usr/lib/$triplet/" "$root"/usr/lib/llvm-*/lib/ -maxdepth 1 -name "$name" \
      -print -quit 2>/dev/null || true)
    if [[ -z $library ]]; then
      echo "$(basename "$file") needs $name, which is not in $root" >&2
      exit 1
    fi
    bundle "$folder" "$library" "$root"
  done
}

# stand_in FOLDER NAME PREFIX USER: a library whose functions, those with the prefix that the user of it names, do nothing.
stand_in() {
  local folder=$1 name=$2 prefix=$3 user=$4 symbols
  symbols=$(readelf --dyn-syms -W "$user" | awk -v prefix="^$prefix" '$7 == "UND" && $8 ~ prefix {print $8}')
  mkdir -p "$folder"
  awk -F@ '{versions[$2] = versions[$2] $1 "; "} END {for (v in versions) print v, "{", versions[v], "};"}' \
    <<<"$symbols" >"$work/stand_in.map"
  sed -E 's/@.*//; s/.*/void &(void) {}/' <<<"$symbols" |
    "$triplet-gcc" -shared -nostdlib -fPIC -o "$folder/$name" -x c - \
      "-Wl,-soname,$name,--version-script=$work/stand_in.map"
}

# licences STAGE DOCUMENT...: what Debian tells of the authors of packages, from their folders of documents.
licences() {
  local stage=$1 folder
  shift
  for folder in "$@"; do
    if [[ -e $folder/copyright ]]; then install -D -m 644 "$folder/copyright" "$stage/licences/$(basename "$folder")"; fi
  done
}

# pack STAGE NAME VERSION METADATA...: a wheel of the folder; more lines of its metadata.
pack() {
  local stage=$1 name=$2 version=$3
  shift 3
  mkdir "$stage/$name-$version.dist-info"
  printf '%s\n' 'Metadata-Version: 2.1' "Name: $name" "Version: $version" "$@" >"$stage/$name-$version.dist-info/METADATA"
  printf '%s\n' 'Wheel-Version: 1.0' 'Generator: cmake/wheel.sh' 'Root-Is-Purelib: false' "Tag: py3-none-$platform" \
    >"$stage/$name-$version.dist-info/WHEEL"
  python3 -m wheel pack "$stage" -d build/wheels
}

echo "== dpr"
version=$(sed -n 's/.*define DPR_VERSION "\(.*\)"/\1/p' include/dpr/version.hpp)
compilers=()
if [[ $arch != "$(dpkg --print-architecture)" ]]; then
  compilers=(-DCMAKE_SYSTEM_NAME=Linux "-DCMAKE_SYSTEM_PROCESSOR=${triplet%%-*}"
    "-DCMAKE_C_COMPILER=$triplet-gcc" "-DCMAKE_CXX_COMPILER=$triplet-g++")
fi
cmake --preset release -B "$work" -DSKBUILD=ON -DDPR_BUILD_{TORCH,CLI,BENCH,LEARN,TESTS}=OFF "${compilers[@]}"
cmake --build "$work" --target dpr_shared
stage=$work/stage/dpr
mkdir -p "$stage"
cp -r "$work/python/dpr" "$stage/"
bundle "$stage/dpr" "$work/lib/libdpr.so.${version%.*}" ""
"$triplet-strip" "$stage/dpr/libdpr.so.${version%.*}"
licences "$stage/dpr" /usr/share/doc/{libopenmesh[0-9]*,ocl-icd-libopencl1}
mapfile -t metadata < <(python3 -c '
import tomllib
project = tomllib.load(open("lib/python/pyproject.toml", "rb"))["project"]
print("Summary:", project["description"])
print("Requires-Python:", project["requires-python"])
for requirement in project["dependencies"]: print("Requires-Dist:", requirement)')
pack "$stage" dpr "$version" "${metadata[@]}"

echo "== dpr_pocl"
pocl_packages=(libpocl2 libllvm15 libclang-cpp15 libhwloc15 libedit2 libbsd0 libmd0 libffi8
  libtinfo6 libudev1 "binutils-${triplet//_/-}" libbinutils binutils-common libctf0 libjansson4 libzstd1)
mkdir -p "$work/pocl/packages"
(cd "$work/pocl/packages" && apt-get download -q libpocl2-common "${pocl_packages[@]/%/:$arch}")
for package in "$work"/pocl/packages/*.deb; do dpkg-deb -x "$package" "$work/pocl"; done
stage=$work/stage/dpr_pocl
libraries=$stage/dpr_pocl/lib/pocl
install -D -m 644 lib/python/dpr_pocl/__init__.py "$stage/dpr_pocl/__init__.py"
# LLVM calls the first for Windows' manifests, the second for the static analyser. They are a quarter of its size.
llvm=$work/pocl/usr/lib/$triplet/libLLVM-15.so.1
stand_in "$libraries" libxml2.so.2 xml "$llvm"
stand_in "$libraries" libz3.so.4 Z3_ "$llvm"
bundle "$libraries" "$work/pocl/usr/lib/$triplet/libpocl.so.2" "$work/pocl"
bundle "$libraries" "$work/pocl/usr/bin/$triplet-ld.bfd" "$work/pocl"
install -D -t "$libraries/pocl" "$work/pocl/usr/lib/$triplet"/pocl/*
patchelf --set-rpath "\$ORIGIN/.." "$libraries"/pocl/*
mkdir "$stage/dpr_pocl/share"
cp -r "$work/pocl/usr/share/pocl" "$stage/dpr_pocl/share/"
# The linker under the name that clang looks for first. Libraries of a C toolchain need not be there, and kernels need
# nothing of them that the process does not have.
kernels=("$stage"/dpr_pocl/share/pocl/kernel-*-gnu-*.bc)
target=$(sed -E 's/.*kernel-(.*-gnu)-.*/\1/' <<<"${kernels[0]}")
install -D /dev/stdin "$stage/dpr_pocl/bin/$target-ld" <<END
#!/bin/sh
# Links a kernel for PoCL, without the libraries that clang names.
for word; do
  shift
  case \$word in -lc | -lm | -lgcc | -lgcc_s) ;; *) set -- "\$@" "\$word" ;; esac
done
exec "\${0%/*}/../lib/pocl/$triplet-ld.bfd" "\$@"
END
licences "$stage/dpr_pocl" "$work"/pocl/usr/share/doc/*
pocl_version=$(dpkg-deb -f "$work"/pocl/packages/libpocl2_*.deb Version)
pack "$stage" dpr_pocl "${pocl_version%%-*}" 'Summary: PoCL, an OpenCL driver for CPUs, for dpr on machines without a driver' \
  'Requires-Python: >=3.8'
