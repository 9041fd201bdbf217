// Folders and text files of the commands.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace tutti::cli {

/// Makes the folder if it is missing. Throws InputError if it can't be made.
void MakeFolder(const std::filesystem::path& folder);

/// Where the results of a recording go if nobody says: tutti-out/NAME, NAME being its folder's, or its file's
/// without the extension, and `suffix`.
std::filesystem::path DefaultOutput(const std::string& recording, const std::string& suffix = "");

/// The text of a JSON file. Names of files need not be UTF-8, JSON has to be: what is not becomes U+FFFD.
std::string JsonText(const nlohmann::ordered_json& json);

/// What a JSON file holds; discarded() if that is no JSON. Throws InputError, which ends with `advice` ("give
/// the summary.json of a run"), if the file can't be read or is too large.
nlohmann::ordered_json ReadJson(const std::filesystem::path& file, const std::string& advice);

/// Throws InputError if a file that is to be written is one of those that are read: a slip in a name, or a
/// disk that is full, would take what the results are made of. Empty names are of options that were not
/// given.
void KeepInputs(const std::vector<std::string>& read, const std::vector<std::string>& written);

/// KeepInputs; throws InputError also for a file that can't be written later, after long work.
void CheckFiles(const std::vector<std::string>& read, const std::vector<std::string>& written);

/// A line on standard error for each of the warnings.
void SayWarnings(const std::vector<std::string>& warnings);

}  // namespace tutti::cli
