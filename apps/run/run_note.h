// What a run was called with, in the words that its maps and checkpoints carry (MapInfo::note).
#pragma once

#include <string>

#include "apps/run/runner.h"

namespace tutti {

/// JSON: data set, configuration's name, ground truth, and what else the configuration does not hold.
std::string NoteOf(const RunRequest& request);

/// What NoteOf made, but that a map which went elsewhere goes into the run's folder: a file that is read
/// names no file that is written. `elsewhere`: where it went; empty: it did not. Throws InputError, with the
/// name of the file, if it is something else.
RunRequest RequestOf(const std::string& note, const std::filesystem::path& file,
                     std::string* elsewhere = nullptr);

/// The data set that NoteOf was given; "" if the note is something else.
std::string DatasetOfNote(const std::string& note);

}  // namespace tutti
