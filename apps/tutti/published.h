// Published errors of other systems, for `tutti evaluate --against`. The figures are in published.tsv.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace tutti::cli {

/// What one paper says of one system on one benchmark.
struct PublishedRow {
  std::string benchmark, system;
  std::string sensor;     ///< mono, stereo, rgbd, stereo-inertial
  std::string alignment;  ///< "se3", "sim3"
  std::string source, protocol;
  std::vector<std::pair<std::string, std::optional<double>>> ate_m;  ///< by sequence; nothing: it failed

  /// Null: the paper has no figure of it.
  const std::optional<double>* Of(const std::string& sequence) const;
};

/// Rows of a table's text. Throws InputError that names the line if it is not well-formed.
std::vector<PublishedRow> ParsePublished(const std::string& text);
/// All rows of published.tsv.
const std::vector<PublishedRow>& PublishedRows();
/// The benchmarks there are, in the order of the table.
std::vector<std::string> PublishedBenchmarks();
/// Sequences of a benchmark, in the order of the table.
std::vector<std::string> PublishedSequences(const std::string& benchmark);
/// The sequence whose name is in the path ("MH_01_easy", "freiburg1_desk2", "poses/00.txt"); empty: none.
std::string SequenceInPath(const std::string& benchmark, const std::string& path);

}  // namespace tutti::cli
