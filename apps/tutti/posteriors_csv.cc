#include "apps/tutti/posteriors_csv.h"

#include <algorithm>
#include <cstdio>

#include "core/replaced_file.h"

namespace tutti::cli {
namespace {

constexpr double kWorthALine = 1e-4;

std::string Lines(const LoopRow& row, const LoopRun& run) {
  const LoopResult& r = row.result;
  std::string text;
  for (std::size_t i = 0; i < r.posterior_by_location.size(); ++i) {
    const auto& [location, combined] = r.posterior_by_location[i];
    double most = combined;
    const LoopLabel label = run.truth.At(static_cast<int>(r.query), static_cast<int>(location));
    char number[64];
    std::snprintf(number, sizeof number, "%ld,%ld,%d,%.6g", run.Number(r.query), run.Number(location),
                  static_cast<int>(label), combined);
    std::string line = number;
    for (const MemberOpinion& member : r.members) {
      // A member that sat this image out has no posterior of it.
      const auto& posterior = member.posterior_by_location;
      const double value = i < posterior.size() ? posterior[i].second : 0.0;
      most = std::max(most, value);
      std::snprintf(number, sizeof number, ",%.6g", value);
      line += number;
    }
    if (most >= kWorthALine || label == LoopLabel::kLoop) text += line + "\n";
  }
  return text;
}

}  // namespace

void WritePosteriors(const LoopRun& run, const std::filesystem::path& file) {
  std::string text = "image,location,truth,combined";
  for (const std::string& name : run.options.members) text += "," + name;
  text += "\n";
  for (const LoopRow& row : run.rows) text += Lines(row, run);
  internal::WriteFile(file, text);
}

}  // namespace tutti::cli
