#include "apps/report/comparison_report.h"

#include <fstream>
#include <map>
#include <set>
#include <system_error>
#include <utility>

#include "apps/report/page.h"

namespace tutti {
namespace {

using Json = nlohmann::ordered_json;
constexpr int kPicturesOfAKind = 2;

void CutGallery(Json& run) {
  Json& gallery = run["gallery"];
  Json kept = Json::array();
  std::map<std::string, int> count;
  for (Json& entry : gallery["entries"]) {
    if (count[entry["outcome"].get<std::string>()]++ < kPicturesOfAKind) kept.push_back(std::move(entry));
  }
  if (kept.size() < gallery["entries"].size())
    gallery["note"] = "A few of each outcome; the run's own report.html has more.";
  gallery["entries"] = std::move(kept);
}

}  // namespace

std::optional<Json> ReadRunReport(const std::filesystem::path& folder) {
  std::error_code ignored;  // nothing else is opened: one waits at a pipe without end
  const std::filesystem::path file = folder / "report.json";
  if (!std::filesystem::is_regular_file(file, ignored)) return std::nullopt;
  std::ifstream in(file, std::ios::binary);
  Json json = Json::parse(in, nullptr, false);
  if (!json.is_object() || json.value("format", 0) != kReportFormat) return std::nullopt;
  return json;
}

Json SingleRunPage(Json run) {
  const std::string name = std::filesystem::path(run["dataset"].get<std::string>()).filename().string();
  Json page = {{"kind", "run"},
               {"title", "tutti: " + (name.empty() ? run["dataset"].get<std::string>() : name)},
               {"subtitle", run["dataset"].get<std::string>() + ", " + run["variant"].get<std::string>()}};
  page["runs"] = Json::array();
  page["runs"].push_back(std::move(run));
  return page;
}

Json ComparisonPage(const std::string& title, const std::vector<ReportTable>& tables, std::vector<Json> runs,
                    const std::vector<std::string>& failures) {
  Json page = {
      {"kind", "comparison"},
      {"title", title},
      {"subtitle",
       "Tables: means over runs, +- half of the 95 % confidence interval. Charts: the first run of each "
       "variant."},
      {"tables", Json::array()},
      {"failures", failures},
      {"runs", Json::array()}};
  for (const ReportTable& table : tables) {
    page["tables"].push_back({{"dataset", table.dataset},
                              {"header", table.header},
                              {"rows", table.rows},
                              {"notes", table.notes},
                              {"stage_header", table.stage_header},
                              {"stage_rows", table.stage_rows}});
  }
  std::set<std::pair<std::string, std::string>> shown;
  for (Json& run : runs) {
    if (!shown.emplace(run["dataset"].get<std::string>(), run["variant"].get<std::string>()).second) continue;
    CutGallery(run);
    page["runs"].push_back(std::move(run));
  }
  return page;
}

}  // namespace tutti
