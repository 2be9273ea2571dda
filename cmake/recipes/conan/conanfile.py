"""The checkout that holds this recipe as a Conan package: conan create cmake/recipes/conan --build=missing"""
import pathlib
import re

from conan import ConanFile
from conan.tools.cmake import CMake, CMakeDeps, CMakeToolchain, cmake_layout
from conan.tools.files import copy

ROOT = pathlib.Path(__file__).parents[3]


class Dpr(ConanFile):
    name = "dpr"
    description = "Differentiable rendering with perturbed optimizers, on OpenCL"
    package_type = "library"
    settings = "os", "arch", "compiler", "build_type"
    options = {"shared": [True, False], "fPIC": [True, False], "tools": [True, False]}
    default_options = {"shared": False, "fPIC": True, "tools": True}
    implements = ["auto_shared_fpic"]

    def set_version(self):
        header = (ROOT / "include/dpr/version.hpp").read_text()
        self.version = re.search(r'DPR_VERSION "(.*)"', header)[1]

    def export_sources(self):
        for pattern in ("CMakeLists.txt", "cmake/*", "include/*", "kernels/*", "lib/*"):
            copy(self, pattern, ROOT, self.export_sources_folder)

    def requirements(self):
        for reference in ("opencl-icd-loader/2023.12.14", "opencl-clhpp-headers/2023.12.14", "glm/cci.20230113"):
            self.requires(reference, transitive_headers=True)
        self.requires("openmesh/11.0")
        for reference in ("eigen/3.4.0", "nlohmann_json/3.11.3", "openimageio/2.5.18.0", "libpng/[>=1.6 <2]"):
            self.requires(reference)
        if self.options.tools:
            self.requires("cli11/2.3.2")

    def layout(self):
        cmake_layout(self)

    def generate(self):
        CMakeDeps(self).generate()
        toolchain = CMakeToolchain(self)
        for part in ("BENCH", "LEARN", "PYTHON", "TESTS", "TORCH"):
            toolchain.cache_variables[f"DPR_BUILD_{part}"] = False
        toolchain.cache_variables["DPR_BUILD_CLI"] = bool(self.options.tools)
        toolchain.generate()

    def build(self):
        cmake = CMake(self)
        cmake.configure()
        cmake.build()

    def package(self):
        CMake(self).install()

    def package_info(self):
        self.cpp_info.set_property("cmake_find_mode", "none")  # dprConfig.cmake is in the package
        self.cpp_info.builddirs = ["lib/cmake/dpr"]
        self.cpp_info.libs = ["dpr"]
