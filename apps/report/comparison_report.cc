// Pages over several runs, and the reports of runs that they are made of.
#include <algorithm>
#include <cstddef>
#include <map>
#include <set>
#include <system_error>
#include <utility>

#include "apps/report/page.h"
#include "core/text_reader.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

using Json = nlohmann::ordered_json;
constexpr int kPicturesOfAKind = 2;
constexpr int kDeepest = 32;                       // values within values; a report has fewer
constexpr std::size_t kMostBytes = 1'000'000'000;  // of a report, with its pictures

bool HasText(const Json& object, const char* key) {
  return object.is_object() && object.contains(key) && object[key].is_string();
}

// What the page is made of: the browser says what else is wrong.
bool IsReport(const Json& json) {
  if (!HasText(json, "dataset") || !HasText(json, "variant")) return false;
  if (!json.contains("gallery") || json["gallery"].is_null()) return true;
  const Json& gallery = json["gallery"];
  if (!gallery.is_object() || !gallery.contains("entries") || !gallery["entries"].is_array()) return false;
  return std::all_of(gallery["entries"].begin(), gallery["entries"].end(),
                     [](const Json& entry) { return HasText(entry, "outcome"); });
}

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
  const char* const advice = "run it again, or remove the file";
  bool deep = false;
  const auto bounded = [&deep](int depth, Json::parse_event_t, Json&) {
    deep = deep || depth > kDeepest;
    return !deep;
  };
  Json json = Json::parse(internal::ReadText(file, advice, kMostBytes), bounded, false);
  const bool other = !deep && json.is_object() && json.contains("format") && json["format"].is_number() &&
                     json["format"] != kReportFormat;
  if (other) return std::nullopt;
  if (deep || !json.is_object() || !json.contains("format") || !json["format"].is_number() || !IsReport(json))
    throw InputError(file.string() + ": is damaged, or no report.json of `tutti run`; " + advice);
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
  Json page = {{"kind", "comparison"},
               {"title", title},
               {"subtitle",
                "Tables: means over runs, +- half of the 95 % confidence interval. Charts: the first run of "
                "each variant."},
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
    run.erase("surface");  // a page of many would be too large
    page["runs"].push_back(std::move(run));
  }
  return page;
}

}  // namespace tutti
