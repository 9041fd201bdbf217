// The columns of a table of runs, and their time per stage: timing.stage_ms of their summary.json
// (docs/outputs.md).
#pragma once

#include <map>
#include <string>
#include <vector>

#include "apps/tutti/comparison.h"
#include "tutti/core/significance.h"

namespace tutti::cli {

constexpr const char* kEnsemble = "ensemble";

MeanInterval Over(const Variant& variant, double RunFigures::*field);
/// ATE of the variant minus that of the ensemble, over the samples that both have.
PairedTTestResult AgainstEnsemble(const Variant& variant, const std::vector<Variant>& all);

/// Words for columns, in the order of the whole table. The variant's name is always the first column.
std::vector<std::string> ComparisonColumns();
/// A row for each variant.
TextTable FiguresTable(const std::vector<Variant>& variants, const TableChoice& choice);

/// Seconds by stage; empty if the summary has none.
std::map<std::string, double> StageSeconds(const nlohmann::ordered_json& summary);
/// Sum of the stages whose name begins so, without those that only wait for others (read_wait, loop_wait,
/// loop_inline); NaN for no stages at all.
double WorkSeconds(const std::map<std::string, double>& stages_s, const std::string& prefix);
/// Every stage of these runs, in the order in which a frame goes through them; waiting comes last.
std::vector<std::string> StageOrder(const std::vector<Variant>& variants);
/// Mean over the runs; one that has stages but not this one spent 0 s on it. No run has it: no value.
MeanInterval StageOver(const Variant& variant, const std::string& stage);
/// A row for each stage, a column for each variant [s].
TextTable StageTable(const std::vector<Variant>& variants);

}  // namespace tutti::cli
