// tutti map prune.
#pragma once

#include <filesystem>

namespace tutti::cli {

/// Removes redundant keyframes from a map (SlamSystem::Prune), writes it to `out`, or back if that is empty,
/// and prints what it was and is. Throws InputError for a file that is no finished map.
void PruneMap(const std::filesystem::path& file, const std::filesystem::path& out);

}  // namespace tutti::cli
