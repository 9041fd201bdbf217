// Writes a text file, or says why it can't.
#pragma once

#include <filesystem>
#include <string>

namespace tutti {

/// Throws InputError if the file can't be written in full.
void WriteTextFile(const std::filesystem::path& file, const std::string& text);

}  // namespace tutti
