// Parts of the library that are loaded when they are needed.
#pragma once

namespace dpr {

/// A function of the module `name`, which is loaded and stays. It is looked for beside the library (or the
/// program, if the library is part of it), where the program's installation has its libraries, and where the
/// system looks. Throws std::runtime_error with the reason.
void* module_function(const char* name, const char* function);

}  // namespace dpr
