// A plot as a file: SVG, PNG or PDF.
#pragma once

#include <filesystem>
#include <vector>

#include "apps/plot/plot_shapes.h"

namespace tutti::cli {

/// Throws InputError if the name's ending is none of .svg, .png, .pdf, or .pdf where tutti was built without
/// Cairo.
void CheckPlotFile(const std::filesystem::path& file);

/// Writes a page of kPlotWidth x kPlotHeight in the format of the name's ending. Throws InputError as
/// CheckPlotFile does, and if the file can't be written in full.
void WritePlotFile(const std::filesystem::path& file, const std::vector<PlotShape>& shapes);

}  // namespace tutti::cli
