// `tutti loops --table`: every rule and every member on one image set, the paper's Table 1 for it.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "apps/tutti/loops/loops_output.h"

namespace tutti::cli {

/// One line of the table.
struct LoopTableRow {
  std::string rule;     ///< the word of --rule, and the name of its folder
  bool single = false;  ///< a member alone
  nlohmann::ordered_json figures;
  LoopReport report;
};

struct LoopTable {
  nlohmann::ordered_json protocol;
  std::vector<int> loop_images;  ///< the images that have a loop; the tests are over them
  std::vector<LoopTableRow> rows;
};

/// The words of --rule that the table runs: mean, product, majority, naive, and each member alone.
std::vector<std::string> TableRules(const LoopDetectorOptions& options);

/// Adds one rule's outcome, and what is common to all rules.
void AddToTable(const LoopRun& run, const LoopReport& report, LoopTable& table);

/// Prints the table and puts table.json, table.md and table.csv into place. Throws InputError if they can't
/// be written.
void WriteLoopTable(const LoopTable& table, OutputFolder& folder);

}  // namespace tutti::cli
