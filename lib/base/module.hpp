// Parts of the library that are loaded when they are needed, and the program that they are loaded into.
#pragma once

#include <filesystem>

namespace dpr {

/// A path of the running program's file, by which it can be executed again.
std::filesystem::path running_program();

/// A function of the module `name`, which is loaded and stays. It is looked for beside the library (or the
/// program, if the library is part of it), where the program's installation has its libraries, and where the
/// system looks. Throws std::runtime_error with the reason.
void* module_function(const char* name, const char* function);

/// The dpr command of the same installation, or build: beside the library (or the program, if the library is
/// part of it), or where the installation has its programs. Empty where there is none.
std::filesystem::path command_file();

}  // namespace dpr
