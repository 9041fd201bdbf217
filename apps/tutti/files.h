// Folders and text files of the commands.
#pragma once

#include <filesystem>
#include <string>

namespace tutti::cli {

/// Makes the folder if it is missing. Throws InputError if it can't be made.
void MakeFolder(const std::filesystem::path& folder);

/// Writes the text. Throws InputError if it can't be written in full.
void WriteText(const std::filesystem::path& file, const std::string& text);

}  // namespace tutti::cli
