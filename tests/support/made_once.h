// What is costly to make and the same for many tests is made once for all of them. ctest starts one program
// per test, so it lies on disk, in the build folder.
#pragma once

#include <filesystem>
#include <functional>
#include <string>

namespace tutti::testing {

/// A folder `name` below the build folder's `tests/made`. `make` fills it the first time that it is asked
/// for, and again when `made_by`, the file of the program or library that it is made with, has other
/// contents; what an earlier one made is removed. Programs that run at the same time wait for each other.
/// Shared: copy what a test changes. If `make` throws, nothing is kept. Throws std::runtime_error if the
/// folder can't be made.
std::filesystem::path MadeOnce(const std::string& name, const std::filesystem::path& made_by,
                               const std::function<void(const std::filesystem::path&)>& make);

/// 16 hexadecimal digits that tell texts apart, for names.
std::string DigestOf(const std::string& text);

}  // namespace tutti::testing
