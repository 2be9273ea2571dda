"""PoCL, an OpenCL driver for CPUs, with the compiler and the linker that it needs, for machines without an OpenCL driver.

`import dpr` calls activate(). Made by cmake/wheel.sh from Debian's packages, whose licences are beside this file.
"""
import os
import pathlib

_FOLDER = pathlib.Path(__file__).resolve().parent
DRIVER = str(_FOLDER / "lib" / "pocl" / "libpocl.so.2")
"""The driver's library, which a file.icd in /etc/OpenCL/vendors, or OCL_ICD_VENDORS, may name."""


def activate():
    """Makes this PoCL the OpenCL driver of this process and of those that it starts, if the system has no driver and the
    environment names none. To be called before the first OpenCL call. Returns whether it did."""
    if any(os.environ.get(name) for name in ("OCL_ICD_VENDORS", "OPENCL_VENDOR_PATH")):
        return os.environ.get("OCL_ICD_VENDORS") == DRIVER
    if any(pathlib.Path("/etc/OpenCL/vendors").glob("*.icd")):
        return False
    os.environ["OCL_ICD_VENDORS"] = DRIVER
    # PoCL runs a linker; in bin it has a name that no other program looks for.
    os.environ["PATH"] = os.pathsep.join(filter(None, (os.environ.get("PATH"), str(_FOLDER / "bin"))))
    return True
