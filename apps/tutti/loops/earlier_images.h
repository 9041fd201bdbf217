// Images of earlier runs of `tutti loops` that its detector knows.
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>

#include "apps/tutti/loops/loops_output.h"
#include "tutti/loopclosure/detector.h"

namespace tutti::cli {

/// A run that goes on from a file numbers its images after those that the file has. Which image each number
/// was is in a list beside it (FILE.images.csv), which grows by a line an image.
class EarlierImages {
 public:
  /// `detector` has what `memory` (ltm_file or --places) holds, and nothing else; empty: it goes on from
  /// nothing. Throws InputError for a list that can't be read or written.
  EarlierImages(const LoopDetector& detector, const std::string& memory);

  /// The number of the first image of this run.
  std::int64_t first() const { return first_; }
  /// Notes the image that has just become a location. Throws InputError if that can't be written.
  void Add(std::int64_t id, const std::filesystem::path& image);
  /// Which image a number was: its path, or where nobody noted it, "image 17 of FILE".
  std::string Name(std::int64_t id) const;

  /// Numbers the result's images from 0 for the first of this run. What is said of earlier images goes into
  /// `row->earlier`: this run's ground truth does not know them.
  void Separate(LoopRow* row) const;

 private:
  void ReadNames();
  [[noreturn]] void Fail(const char* what) const;

  std::string memory_;          // empty: none
  std::filesystem::path list_;  // of names
  std::int64_t first_ = 0;
  std::map<std::int64_t, std::string> names_;
  std::ofstream out_;
};

/// The loops into earlier images, a line each.
std::string EarlierLoopsCsv(const LoopRun& run);

}  // namespace tutti::cli
