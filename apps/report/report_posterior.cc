// What each member and the ensemble believed over time, and what was decided: heat maps of few cells, and one
// image to a column.
#include <algorithm>
#include <set>
#include <tuple>

#include "apps/report/report_parts.h"

namespace tutti::report {
namespace {

constexpr std::size_t kMostCells = 220;  // along either axis
constexpr std::size_t kMostTimes = 800;  // of a curve

// Which cell of `cells` the k-th of `size` falls into.
std::size_t CellOf(std::size_t k, std::size_t size, std::size_t cells) { return k * cells / size; }

// The images of a run as columns, and its places as rows.
struct Grid {
  std::size_t cells = 0;
  std::vector<std::size_t> shown;   // by column: index of the one image in it that is shown
  std::map<std::int64_t, int> row;  // by query: where it is as a place
};

// The row that holds a place, -1 if it is not of this run.
int RowOf(const Grid& grid, std::int64_t location) {
  const auto at = grid.row.find(location);
  return at == grid.row.end() ? -1 : at->second;
}

// The image of a column that says most has the largest.
auto HowTelling(const LoggedDetection& detection) {
  return std::make_tuple(detection.verified, detection.proposed, detection.probability,
                         detection.opinions.empty() ? 0.0 : detection.opinions.back().hypothesis);
}

Grid MakeGrid(const std::vector<LoggedDetection>& detections) {
  Grid grid;
  grid.cells = std::min(kMostCells, detections.size());
  for (std::size_t k = 0; k < detections.size(); ++k) {
    const std::size_t cell = CellOf(k, detections.size(), grid.cells);
    grid.row[detections[k].query] = static_cast<int>(cell);
    if (cell == grid.shown.size()) {
      grid.shown.push_back(k);
    } else if (HowTelling(detections[k]) > HowTelling(detections[grid.shown.back()])) {
      grid.shown.back() = k;
    }
  }
  return grid;
}

// One opinion in the cells: `fill` raises those of an image by raise(row, byte).
template <class Fill>
Json CellsJson(const std::vector<LoggedDetection>& detections, const Grid& grid, std::size_t opinion,
               const Fill& fill) {
  std::vector<unsigned char> bytes(grid.cells * grid.cells, 0);
  for (std::size_t column = 0; column < grid.cells; ++column) {
    const LoggedDetection& detection = detections[grid.shown[column]];
    if (opinion >= detection.opinions.size()) continue;
    fill(detection, detection.opinions[opinion], [&](std::size_t row, unsigned char value) {
      unsigned char& cell = bytes[row * grid.cells + column];
      cell = std::max(cell, value);
    });
  }
  return {{"name", detections.back().opinions[opinion].name}, {"q", Base64(bytes.data(), bytes.size())}};
}

Json PosteriorMap(const std::vector<LoggedDetection>& detections, const Grid& grid, std::size_t opinion) {
  return CellsJson(
      detections, grid, opinion, [&](const LoggedDetection&, const LoggedOpinion& of, const auto& raise) {
        for (const auto& [location, p] : of.posterior) {
          const int row = RowOf(grid, location);
          const double root = std::sqrt(std::clamp(static_cast<double>(p), 0.0, 1.0));
          if (row >= 0)
            raise(static_cast<std::size_t>(row), static_cast<unsigned char>(std::lround(255 * root)));
        }
      });
}

Json EvidenceMap(const std::vector<LoggedDetection>& detections, const Grid& grid, std::size_t opinion) {
  const auto cell_of = [&](std::size_t k) { return CellOf(k, detections.size(), grid.cells); };
  return CellsJson(detections, grid, opinion,
                   [&](const LoggedDetection& detection, const LoggedOpinion& of, const auto& raise) {
                     for (std::size_t g = 0; g < of.evidence.size(); ++g) {
                       const std::size_t first = g * detection.group;
                       const std::size_t last = std::min(first + detection.group, detections.size()) - 1;
                       for (std::size_t row = cell_of(first); row <= cell_of(last); ++row)
                         raise(row, of.evidence[g]);
                     }
                   });
}

Json GeometryJson(const RunResult& result, const Verification& geometry, const Grid& grid) {
  if (geometry.candidate < 0 || !result.config.loops.verification.enabled) return Json();
  return {{"place", geometry.candidate},
          {"row", RowOf(grid, geometry.candidate)},
          {"mass", Rounded(geometry.mass, 4)},
          {"matches", geometry.matches},
          {"inliers", geometry.inliers},
          {"coverage", geometry.coverage},
          {"log_nfa", Rounded(geometry.log_nfa, 1)},
          {"spread", Rounded(geometry.motion_spread, 4)}};
}

// What became of the images that were proposed or should have been.
struct Outcomes {
  std::map<std::int64_t, const ShownLoop*> proposed;
  std::set<std::int64_t> missed;
};

Outcomes OutcomesOf(const std::vector<ShownLoop>& loops) {
  Outcomes outcomes;
  for (const ShownLoop& loop : loops) {
    if (loop.outcome == Outcome::kMissed) {
      outcomes.missed.insert(loop.query);
    } else if (loop.detection != nullptr) {
      outcomes.proposed.emplace(loop.query, &loop);
    }
  }
  return outcomes;
}

Json ImageJson(const RunResult& result, const LoggedDetection& detection, const Outcomes& outcomes,
               const Grid& grid) {
  const auto loop = outcomes.proposed.find(detection.query);
  const bool listed = loop != outcomes.proposed.end();
  const LoggedOpinion& ensemble = detection.opinions.back();
  Json members = Json::array();
  for (std::size_t o = 0; o + 1 < detection.opinions.size(); ++o) {
    const LoggedOpinion& member = detection.opinions[o];
    members.push_back(member.took_part ? Json{Rounded(member.weight, 3), Rounded(member.hypothesis, 4),
                                              member.best, Rounded(member.at_candidate, 4)}
                                       : Json());
  }
  return {{"query", detection.query},
          {"new", Rounded(1 - ensemble.hypothesis, 4)},
          {"candidate", ensemble.best},
          {"row", RowOf(grid, ensemble.best)},
          {"posterior", Rounded(detection.posterior, 4)},
          {"outcome", listed ? ToString(loop->second->outcome) : "none"},
          {"missed", outcomes.missed.count(detection.query) != 0},
          {"probability", detection.proposed ? Rounded(detection.probability, 4) : Json()},
          {"reason", listed ? loop->second->reason : detection.reason},
          {"geometry", GeometryJson(result, detection.geometry, grid)},
          {"members", std::move(members)}};
}

// Hypotheses of all and weights of the members, over time.
void AddCurves(const std::vector<LoggedDetection>& detections, std::size_t first_hypothesis, Json& json) {
  json["hypothesis_t"] = Json::array();
  json["hypotheses"] = json["weights"] = Json::array();
  const std::vector<std::size_t> times = Thinned(detections.size(), kMostTimes);
  for (const std::size_t k : times)
    json["hypothesis_t"].push_back(Rounded(detections[k].stamp_s - detections.front().stamp_s, 2));
  const std::vector<LoggedOpinion>& names = detections.back().opinions;
  for (std::size_t o = 0; o < names.size(); ++o) {
    Json hypotheses = Json::array(), weights = Json::array();
    for (const std::size_t k : times) {
      const bool there = o < detections[k].opinions.size();
      const bool took_part = there && detections[k].opinions[o].took_part;
      hypotheses.push_back(took_part ? Rounded(detections[k].opinions[o].hypothesis, 4) : Json());
      weights.push_back(there ? Rounded(detections[k].opinions[o].weight, 3) : Json());
    }
    if (o >= first_hypothesis)
      json["hypotheses"].push_back({{"name", names[o].name}, {"h", std::move(hypotheses)}});
    if (o + 1 < names.size()) json["weights"].push_back({{"name", names[o].name}, {"w", std::move(weights)}});
  }
}

}  // namespace

Json PosteriorJson(const RunResult& result, const DetectionLog& log, const std::vector<ShownLoop>& loops) {
  const auto& detections = log.detections();
  if (detections.size() < 2) return Json();
  const Grid grid = MakeGrid(detections);
  const double begin_s = detections.front().stamp_s;
  std::vector<double> place_t(grid.cells, 0);
  for (std::size_t k = 0; k < detections.size(); ++k)
    place_t[CellOf(k, detections.size(), grid.cells)] = detections[k].stamp_s - begin_s;
  Json json = {{"cells", grid.cells},
               {"threshold", result.config.loops.propose_threshold},
               {"loop_threshold", result.config.loops.loop_threshold},
               {"first_stamp_s", Rounded(begin_s, 6)}};
  json["t"] = json["place_t"] = Json::array();
  for (const std::size_t k : grid.shown) json["t"].push_back(Rounded(detections[k].stamp_s - begin_s, 2));
  for (const double t : place_t) json["place_t"].push_back(Rounded(t, 2));
  const std::vector<LoggedOpinion>& names = detections.back().opinions;
  const std::size_t first = names.size() == 2 ? 1 : 0;  // a member alone is the whole ensemble
  json["maps"] = Json::array();
  for (std::size_t o = first; o < names.size(); ++o)
    json["maps"].push_back(PosteriorMap(detections, grid, o));
  json["evidence"] = {{"zero", EvidenceByte::kZero}, {"step", EvidenceByte::kStep}, {"maps", Json::array()}};
  const bool joint = result.config.loops.rule == CombinationRule::kJoint;
  for (std::size_t o = 0; o + (joint ? 0 : 1) < names.size(); ++o)
    json["evidence"]["maps"].push_back(EvidenceMap(detections, grid, o));
  json["images"] = Json::array();
  const Outcomes outcomes = OutcomesOf(loops);
  for (const std::size_t k : grid.shown)
    json["images"].push_back(ImageJson(result, detections[k], outcomes, grid));
  AddCurves(detections, first, json);
  return json;
}

}  // namespace tutti::report
