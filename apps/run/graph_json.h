// What the solution of a pose graph came to, as JSON: the same in summary.json and for `tutti optimize`.
#pragma once

#include <nlohmann/json.hpp>
#include <vector>

#include "tutti/backend/certificate.h"
#include "tutti/backend/pose_graph_optimizer.h"

namespace tutti {

/// Each start with its objective there and at the end.
inline nlohmann::ordered_json StartsJson(const std::vector<StartOutcome>& starts) {
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (const StartOutcome& start : starts) {
    rows.push_back({{"start", ToString(start.start)},
                    {"initial_objective", start.initial_objective},
                    {"objective", start.objective},
                    {"spared", start.spared}});
  }
  return rows;
}

/// Whether there is a certificate, and what it says.
inline nlohmann::ordered_json CertificateJson(const Certificate& certificate) {
  return {{"available", certificate.available},     {"certified", certificate.certified},
          {"reason", certificate.reason},           {"chordal", certificate.chordal},
          {"lower_bound", certificate.lower_bound}, {"relative_gap", certificate.relative_gap}};
}

}  // namespace tutti
