// Folders and text files of the commands.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

namespace tutti::cli {

/// Makes the folder if it is missing. Throws InputError if it can't be made.
void MakeFolder(const std::filesystem::path& folder);

/// Where the results of a recording go if nobody says: tutti-out/NAME, NAME being its folder's, or its file's
/// without the extension, and `suffix`.
std::filesystem::path DefaultOutput(const std::string& recording, const std::string& suffix = "");

/// The text of a JSON file. Names of files need not be UTF-8, JSON has to be: what is not becomes U+FFFD.
std::string JsonText(const nlohmann::ordered_json& json);

/// Writes the text. Throws InputError if it can't be written in full.
void WriteText(const std::filesystem::path& file, const std::string& text);

}  // namespace tutti::cli
