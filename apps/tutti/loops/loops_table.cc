// The table of `tutti loops --table`.
#include <algorithm>
#include <cstdio>

#include "apps/tutti/files.h"
#include "apps/tutti/loops/loops_output.h"
#include "apps/tutti/text_table.h"
#include "core/replaced_file.h"
#include "tutti/core/significance.h"

namespace tutti::cli {
namespace {

using Json = nlohmann::ordered_json;

// The two rankings that are tested: with and without verification. Nobody may close a loop with the third.
struct Ranking {
  const char* name;
  LoopEvaluation LoopReport::*evaluation;
};
constexpr Ranking kRankings[] = {{"verified", &LoopReport::verified}, {"posterior", &LoopReport::posterior}};

const LoopTableRow* Find(const LoopTable& table, const std::string& rule) {
  for (const LoopTableRow& row : table.rows) {
    if (row.rule == rule) return &row;
  }
  return nullptr;
}

// By recall at 100 % precision, then by the area; the first of equals.
const LoopTableRow* BestSingle(const LoopTable& table, const Ranking& ranking) {
  const LoopTableRow* best = nullptr;
  for (const LoopTableRow& row : table.rows) {
    if (!row.single) continue;
    const LoopEvaluation& e = row.report.*ranking.evaluation;
    if (best == nullptr) {
      best = &row;
      continue;
    }
    const LoopEvaluation& b = best->report.*ranking.evaluation;
    if (std::make_pair(e.recall_at_100_precision, e.area_under_curve) >
        std::make_pair(b.recall_at_100_precision, b.area_under_curve))
      best = &row;
  }
  return best;
}

std::vector<bool> Found(const LoopTable& table, const LoopEvaluation& evaluation) {
  std::vector<bool> found;
  const std::vector<int>& images = evaluation.found_at_100_precision;
  for (const int image : table.loop_images)
    found.push_back(std::binary_search(images.begin(), images.end(), image));
  return found;
}

Json Compare(const LoopTable& table, const Ranking& ranking, const LoopTableRow& a, const LoopTableRow& b) {
  const std::vector<bool> found_a = Found(table, a.report.*ranking.evaluation);
  const std::vector<bool> found_b = Found(table, b.report.*ranking.evaluation);
  const McNemarResult mcnemar = McNemarTest(found_a, found_b);
  const PairedTTestResult t = PairedTTest(std::vector<double>(found_a.begin(), found_a.end()),
                                          std::vector<double>(found_b.begin(), found_b.end()));
  Json json = {{"ranking", ranking.name}, {"a", a.rule}, {"b", b.rule}, {"images", table.loop_images.size()}};
  json["mcnemar"] = {{"only_a", mcnemar.only_a},
                     {"only_b", mcnemar.only_b},
                     {"method", mcnemar.exact ? "exact binomial" : "chi-square, continuity-corrected"},
                     {"chi_square", mcnemar.chi_square},
                     {"p", mcnemar.p}};
  json["t_test"] = {{"mean_difference", t.mean_difference},
                    {"t", t.t},  // infinite: null
                    {"degrees_of_freedom", std::max(0, t.pairs - 1)},
                    {"p", t.p}};
  return json;
}

Json Significance(const LoopTable& table) {
  Json tests = Json::array();
  for (const Ranking& ranking : kRankings) {
    const LoopTableRow *joint = Find(table, "joint"), *mean = Find(table, "mean"),
                       *naive = Find(table, "naive");
    const LoopTableRow* single = BestSingle(table, ranking);
    for (const auto& [a, b] :
         {std::make_pair(joint, mean), std::make_pair(joint, naive), std::make_pair(joint, single),
          std::make_pair(mean, naive), std::make_pair(mean, single), std::make_pair(naive, single)}) {
      if (a != nullptr && b != nullptr) tests.push_back(Compare(table, ranking, *a, *b));
    }
  }
  return tests;
}

std::string PercentCell(const Json& share) { return Formatted("%.1f", 100 * share.get<double>()); }

// "95.5 / 88.6": with verification / posterior only.
std::string Both(const Json& figures, const std::string& key, const char* inner = nullptr) {
  const auto value = [&](const std::string& name) {
    return PercentCell(inner == nullptr ? figures[name] : figures[name][inner]);
  };
  return value(key) + " / " + value(key + "_posterior");
}

// "3.1 (n = 42)"; "-" where there is nothing to calibrate.
std::string Calibration(const Json& figures, const std::string& suffix) {
  const Json& error = figures["calibration_error" + suffix];
  if (error.is_null()) return "-";
  return PercentCell(error) + " (n = " + std::to_string(figures["calibration_images" + suffix].get<int>()) +
         ")";
}

std::string TableLine(const std::vector<std::string>& cells) {
  static constexpr int kWidths[] = {8, 25, 33, 13, 13, 24, 22, 17, 17, 12};
  std::string line = "|";
  for (std::size_t k = 0; k < cells.size(); ++k) {
    std::string cell = cells[k];
    cell.resize(std::max(cell.size(), static_cast<std::size_t>(kWidths[k])), ' ');
    line += " " + cell + " |";
  }
  return line + "\n";
}

std::string PText(double p) { return p < 1e-4 ? Formatted("%.1e", p) : Formatted("%.4f", p); }

std::string SignificanceText(const Json& tests) {
  std::string text;
  for (const Json& test : tests) {
    const Json& m = test["mcnemar"];
    const Json& t = test["t_test"]["t"];  // null: infinite
    const std::string a = test["a"].get<std::string>(), b = test["b"].get<std::string>();
    text += Formatted(
        "* %s against %s, %s: found only by %s %d, only by %s %d; McNemar (%s) p = %s; paired t-test t(%d) = "
        "%.2f, p = %s\n",
        a.c_str(), b.c_str(), test["ranking"] == "verified" ? "with verification" : "posterior only",
        a.c_str(), m["only_a"].get<int>(), b.c_str(), m["only_b"].get<int>(),
        m["method"].get<std::string>().c_str(), PText(m["p"]).c_str(),
        test["t_test"]["degrees_of_freedom"].get<int>(), t.is_number() ? t.get<double>() : 0.0,
        PText(test["t_test"]["p"]).c_str());
  }
  return text;
}

std::string Markdown(const LoopTable& table, const Json& json) {
  const Json& p = table.protocol;
  std::string text = "Images: " + std::to_string(json["images"].get<int>()) + " of " +
                     p["image_folder"].get<std::string>() + ", stride " +
                     std::to_string(p["stride"].get<int>()) + ", " +
                     std::to_string(json["rows_with_loop"].get<int>()) + " with a loop.  \n";
  text += "Ground truth: " + p["ground_truth"].get<std::string>() + "; tolerance " +
          std::to_string(p["tolerance_frames"].get<int>()) + " frames.  \n";
  text += "Exclusion: " + p["exclusion"].get<std::string>() + ".  \n";
  text += "Threshold: " + p["threshold"].get<std::string>() + ".  \n";
  text +=
      "Figures in %: with verification / posterior only. Ranked: images that the verification refused stay, "
      "behind the accepted ones; no loop can be closed with them. Calibration error: of the accepted images' "
      "probability / of H from the threshold on, over n images.\n\n";
  text += TableLine({"rule", "recall at 100 % precision", "recall at 100 % precision, ranked", "area",
                     "best F1", "precision at the default", "recall at the default", "F1 at the default",
                     "calibration error", "ms per image"});
  text += "|---|---|---|---|---|---|---|---|---|---|\n";
  for (const LoopTableRow& row : table.rows) {
    text += TableLine(
        {row.rule, Both(row.figures, "recall_at_100_precision"),
         PercentCell(row.figures["recall_at_100_precision_ranked"]), Both(row.figures, "area_under_curve"),
         Both(row.figures, "best_f1"), Both(row.figures, "at_default_threshold", "precision"),
         Both(row.figures, "at_default_threshold", "recall"), Both(row.figures, "f1_at_default"),
         Calibration(row.figures, "") + " / " + Calibration(row.figures, "_posterior"),
         Formatted("%.1f", row.report.ms_median)});
  }
  text += "\nOver the images with a loop, found at each rule's own threshold of 100 % precision or not:\n\n";
  return text + SignificanceText(json["significance"]);
}

std::string TableCsv(const LoopTable& table) {
  std::string text = "rule";
  const std::vector<std::string> keys = {"recall_at_100_precision", "area_under_curve", "best_f1"};
  const std::vector<std::string> suffixes = {"", "_posterior", "_ranked"};
  for (const std::string& suffix : suffixes) {
    const auto add = [&](const std::string& key) { text.append(",").append(key).append(suffix); };
    for (const std::string& key : keys) add(key);
    add("calibration_error");
    add("calibration_images");
    if (suffix == "_ranked") continue;  // decides as the verified ones
    add("precision_at_default_threshold");
    add("recall_at_default_threshold");
    add("f1_at_default");
  }
  text += ",ms_per_image_median,ms_per_image_p99\n";
  const auto number = [](const Json& value) {
    return value.is_null() ? std::string(",") : Formatted(",%.9g", value.get<double>());
  };
  for (const LoopTableRow& row : table.rows) {
    text += row.rule;
    for (const std::string& suffix : suffixes) {
      for (const std::string& key : keys) text += number(row.figures[key + suffix]);
      text += number(row.figures["calibration_error" + suffix]) +
              number(row.figures["calibration_images" + suffix]);
      if (suffix == "_ranked") continue;
      const Json& rates = row.figures["at_default_threshold" + suffix];
      text += number(rates["precision"]) + number(rates["recall"]) +
              number(row.figures["f1_at_default" + suffix]);
    }
    text += number(row.report.ms_median) + number(row.report.ms_p99) + "\n";
  }
  return text;
}

}  // namespace

std::vector<std::string> TableRules(const LoopDetectorOptions& options) {
  std::vector<std::string> rules;
  for (const char* word : {"joint", "mean", "log-pool", "product", "majority", "naive"}) {
    LoopDetectorOptions tried = options;
    SetRule(word, tried);
    // Its one filter works on counts in one memory: other options leave it out.
    if (tried.rule == CombinationRule::kJoint && !tried.Validate().empty()) continue;
    rules.emplace_back(word);
  }
  rules.insert(rules.end(), options.members.begin(), options.members.end());
  return rules;
}

void AddToTable(const LoopRun& run, const LoopReport& report, LoopTable& table) {
  if (table.rows.empty()) {
    table.protocol = ProtocolJson(run);
    for (int row = 0; row < run.truth.size(); ++row) {
      if (run.truth.HasLoop(row)) table.loop_images.push_back(row);
    }
  }
  LoopTableRow row;
  row.rule = RuleName(run.options);
  row.single = run.options.rule == CombinationRule::kSingle;
  row.figures = FiguresJson(run, report);
  row.report = report;
  table.rows.push_back(std::move(row));
}

void WriteLoopTable(const LoopTable& table, OutputFolder& folder) {
  Json json;
  json["protocol"] = table.protocol;
  json["images"] = table.rows.empty() ? 0 : table.rows.front().report.verified.images;
  json["rows_with_loop"] = table.loop_images.size();
  json["rules"] = Json::object();
  for (const LoopTableRow& row : table.rows) json["rules"][row.rule] = row.figures;
  json["best_single"] = Json::object();
  for (const Ranking& ranking : kRankings) {
    const LoopTableRow* best = BestSingle(table, ranking);
    if (best != nullptr) json["best_single"][ranking.name] = best->rule;
  }
  json["significance"] = Significance(table);
  const std::string markdown = Markdown(table, json);
  std::printf("%s\n", markdown.c_str());
  using File = const std::filesystem::path&;
  folder.Write({"table.json", [&](File file) { internal::WriteFile(file, JsonText(json)); }});
  folder.Write({"table.md", [&](File file) { internal::WriteFile(file, markdown); }});
  folder.Write({"table.csv", [&](File file) { internal::WriteFile(file, TableCsv(table)); }});
  ThrowFailures(folder.failures(), folder.Finish(true));
  std::printf("written: %s, table.md, table.csv, and a folder for each rule\n",
              (folder.path() / "table.json").string().c_str());
}

}  // namespace tutti::cli
