// The posterior of each member and of the ensemble over time, as heat maps of few cells.
#include <algorithm>

#include "report_parts.h"

namespace tutti::report {
namespace {

constexpr std::size_t kMostCells = 220;  // along either axis

// Which cell of `cells` the k-th of `size` falls into.
std::size_t CellOf(std::size_t k, std::size_t size, std::size_t cells) { return k * cells / size; }

Json MapJson(const std::string& name, const DetectionLog& log,
             const std::map<std::int64_t, std::size_t>& place, std::size_t opinion, std::size_t cells) {
  const auto& detections = log.detections();
  std::vector<unsigned char> bytes(cells * cells, 0);
  for (std::size_t k = 0; k < detections.size(); ++k) {
    if (opinion >= detections[k].opinions.size()) continue;
    for (const auto& [location, p] : detections[k].opinions[opinion].posterior) {
      const auto at = place.find(location);
      if (at == place.end()) continue;
      unsigned char& cell =
          bytes[CellOf(at->second, detections.size(), cells) * cells + CellOf(k, detections.size(), cells)];
      const double root = std::sqrt(std::clamp(static_cast<double>(p), 0.0, 1.0));
      cell = std::max(cell, static_cast<unsigned char>(std::lround(255 * root)));
    }
  }
  return {{"name", name}, {"q", Base64(bytes.data(), bytes.size())}};
}

}  // namespace

Json PosteriorJson(const RunResult& result, const DetectionLog& log) {
  const auto& detections = log.detections();
  if (detections.size() < 2) return Json();
  const std::size_t cells = std::min(kMostCells, detections.size());
  std::map<std::int64_t, std::size_t> place;
  std::vector<double> cell_t(cells, 0);
  for (std::size_t k = 0; k < detections.size(); ++k) {
    place[detections[k].query] = k;
    cell_t[CellOf(k, detections.size(), cells)] = detections[k].stamp_s - detections.front().stamp_s;
  }
  Json json = {{"cells", cells}, {"threshold", result.config.loops.propose_threshold}, {"t", Json::array()}};
  for (const double t : cell_t) json["t"].push_back(Rounded(t, 2));
  json["first_stamp_s"] = Rounded(detections.front().stamp_s, 6);
  json["maps"] = Json::array();
  json["hypotheses"] = Json::array();
  const std::vector<LoggedOpinion>& names = detections.back().opinions;
  const std::size_t first = names.size() == 2 ? 1 : 0;  // a member alone is the whole ensemble
  for (std::size_t o = first; o < names.size(); ++o) {
    json["maps"].push_back(MapJson(names[o].name, log, place, o, cells));
    Json values = Json::array();
    for (const std::size_t k : Thinned(detections.size(), 800)) {
      const bool there = o < detections[k].opinions.size() && detections[k].opinions[o].took_part;
      values.push_back(there ? Rounded(detections[k].opinions[o].hypothesis, 4) : Json());
    }
    json["hypotheses"].push_back({{"name", names[o].name}, {"h", values}});
  }
  json["hypothesis_t"] = Json::array();
  for (const std::size_t k : Thinned(detections.size(), 800))
    json["hypothesis_t"].push_back(Rounded(detections[k].stamp_s - detections.front().stamp_s, 2));
  return json;
}

}  // namespace tutti::report
