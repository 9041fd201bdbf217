// tutti compare-loops: the paper's t-test between rules, over several image sets.
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "apps/tutti/commands.h"
#include "apps/tutti/files.h"
#include "apps/tutti/text_table.h"
#include "core/replaced_file.h"
#include "tutti/core/error.h"
#include "tutti/core/significance.h"

namespace tutti::cli {
namespace {

using Json = nlohmann::ordered_json;

struct CompareLoopsArguments {
  std::vector<std::string> tables;
  std::string out;
};

Json ReadTable(const std::string& file) {
  Json table = ReadJson(file, "give a table.json of `tutti loops --table`");
  if (!table.is_object() || !table.contains("rules") || !table.contains("best_single"))
    throw InputError(file + ": is no table.json of `tutti loops --table`");
  return table;
}

// One recall per table; `rule` "best single" is each table's own best member.
std::vector<double> Recalls(const CompareLoopsArguments& arguments, const std::vector<Json>& tables,
                            const std::string& rule, const std::string& ranking) {
  const std::string key =
      ranking == "verified" ? "recall_at_100_precision" : "recall_at_100_precision_posterior";
  const std::string absent =
      ": has no " + key + " of the rule '" + rule + "'; write it anew with `tutti loops --table`";
  std::vector<double> recalls;
  recalls.reserve(tables.size());
  for (std::size_t i = 0; i < tables.size(); ++i) {
    try {
      const std::string name =
          rule == "best single" ? tables[i].at("best_single").at(ranking).get<std::string>() : rule;
      recalls.push_back(tables[i].at("rules").at(name).at(key).get<double>());
    } catch (const Json::exception&) {
      throw InputError(arguments.tables[i] + absent);
    }
  }
  return recalls;
}

int CompareLoops(const CompareLoopsArguments& arguments) {
  CheckFiles(arguments.tables, {arguments.out});
  std::vector<Json> tables;
  for (const std::string& file : arguments.tables) tables.push_back(ReadTable(file));
  Json tests = Json::array();
  const std::vector<std::pair<const char*, const char*>> pairs = {
      {"joint", "mean"}, {"joint", "naive"}, {"joint", "best single"}, {"naive", "best single"}};
  std::printf("%-10s %-12s %-12s %5s %16s %9s %9s\n", "ranking", "a", "b", "sets", "mean difference", "t",
              "p");
  for (const char* ranking : {"verified", "posterior"}) {
    for (const auto& [a, b] : pairs) {
      const std::vector<double> recalls_a = Recalls(arguments, tables, a, ranking);
      const std::vector<double> recalls_b = Recalls(arguments, tables, b, ranking);
      const PairedTTestResult t = PairedTTest(recalls_a, recalls_b);
      tests.push_back({{"ranking", ranking},
                       {"a", a},
                       {"b", b},
                       {"recalls_a", recalls_a},
                       {"recalls_b", recalls_b},
                       {"sets", t.pairs},
                       {"mean_difference", t.mean_difference},
                       {"t", t.t}});  // infinite: null
      if (t.pairs >= kLeastPairs) tests.back()["p"] = t.p;
      const std::string p = t.pairs >= kLeastPairs ? Fixed(t.p, 4) : "-";
      std::printf("%-10s %-12s %-12s %5d %15.2f%% %9.3f %9s\n", ranking, a, b, t.pairs,
                  100 * t.mean_difference, t.t, p.c_str());
    }
  }
  if (tables.size() < static_cast<std::size_t>(kLeastPairs)) {
    std::printf("p is given from %d sets on: with fewer, one lucky set decides\n", kLeastPairs);
  }
  if (!arguments.out.empty()) internal::WriteFile(arguments.out, JsonText(tests));
  return 0;
}

}  // namespace

void SetUpCompareLoops(CLI::App& command, int& exit_code) {
  auto arguments = std::make_shared<CompareLoopsArguments>();
  command.add_option("tables", arguments->tables, "table.json files of `tutti loops --table`, one per set")
      ->required();
  command.add_option("--out", arguments->out, "JSON file for the outcome (default: print only)");
  command.callback([arguments, &exit_code] { exit_code = CompareLoops(*arguments); });
}

}  // namespace tutti::cli
