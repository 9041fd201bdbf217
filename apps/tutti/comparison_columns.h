// The columns of a table of runs.
#pragma once

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
/// A row for each variant. Throws InputError that names a column that there is not.
TextTable FiguresTable(const std::vector<Variant>& variants, const TableChoice& choice);

}  // namespace tutti::cli
