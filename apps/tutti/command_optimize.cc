// tutti optimize: a g2o file in, its optimum out.
#include <algorithm>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "apps/run/graph_json.h"
#include "apps/run/progress.h"
#include "apps/tutti/commands.h"
#include "apps/tutti/files.h"
#include "apps/tutti/options.h"
#include "core/replaced_file.h"
#include "tutti/backend/certificate.h"
#include "tutti/backend/g2o_io.h"
#include "tutti/backend/pose_graph_optimizer.h"
#include "tutti/core/error.h"

namespace tutti::cli {
namespace {

struct OptimizeArguments {
  std::string in, out, json;
  BadInformation bad_information = BadInformation::kRefuse;
  bool certify = false, ignore_unknown = false;
  PoseGraphOptions options;
};

/// As --help shows it.
template <class Enum>
void AddChoice(CLI::App& command, const std::string& name, Enum& value, Enum without,
               const std::string& text) {
  value = without;
  AddWord(command, name, value, text, WordsOf(value))->default_str(WordOf(value));
}

nlohmann::ordered_json ToJson(const GraphCosts& costs) {
  return {{"chi2", costs.chi2}, {"chi2log", costs.chi2log}, {"chordal", costs.chordal}};
}

/// Loops that the robust loss rejects, worst first.
std::vector<std::size_t> DownWeighted(const PoseGraphReport& report) {
  std::vector<std::size_t> out;
  for (std::size_t e = 0; e < report.edges.size(); ++e) {
    if (report.edges[e].down_weighted) out.push_back(e);
  }
  std::stable_sort(out.begin(), out.end(),
                   [&](std::size_t a, std::size_t b) { return report.edges[a].chi2 > report.edges[b].chi2; });
  return out;
}

/// A number; as text where the file writes it in a way that a number would not keep.
nlohmann::ordered_json IdJson(const PoseGraph& graph, NodeId id) {
  const std::string name = graph.NameOf(id);
  if (name == std::to_string(id)) return id;
  return name;
}

std::size_t Loops(const PoseGraph& graph) {
  return static_cast<std::size_t>(
      std::count_if(graph.edges().begin(), graph.edges().end(),
                    [](const PoseGraphEdge& edge) { return edge.kind == EdgeKind::kLoop; }));
}

nlohmann::ordered_json ToJson(const OptimizeArguments& arguments, const G2oFile& file,
                              const PoseGraphReport& report, const std::optional<Certificate>& certificate) {
  nlohmann::ordered_json json;
  json["input"] = arguments.in;
  json["kind"] = ToString(file.graph.kind());
  json["nodes"] = file.graph.nodes().size();
  json["edges"] = file.graph.edges().size();
  json["loops"] = Loops(file.graph);
  json["landmarks"] = file.graph.landmarks().size();
  json["measurements"] = file.graph.measurements().size();
  json["ignored_lines"] = file.ignored;
  json["bad_information"] = {{"treatment", ToString(arguments.bad_information)},
                             {"edges", file.bad_information},
                             {"skipped", file.skipped}};
  json["objective"] = ToString(arguments.options.objective);
  json["robust"] = ToString(arguments.options.robust);
  json["solver"] = ToString(report.solver);
  json["solver_note"] = report.solver_note;
  json["init"] = ToString(arguments.options.init);
  json["start"] = ToString(report.start);
  json["starts"] = StartsJson(report.starts);
  json["success"] = report.success;
  json["reason"] = report.reason;
  json["initial_costs"] = ToJson(report.initial_costs);
  json["costs"] = ToJson(report.costs);
  json["iterations"] = report.iterations;
  json["gnc_rounds"] = report.gnc_rounds;
  json["termination"] = report.termination;
  json["time_s"] = report.time_s;
  json["init_time_s"] = report.init_time_s;
  json["components"] = nlohmann::ordered_json::array();
  for (const GraphComponent& component : report.components) {
    json["components"].push_back(
        {{"anchor", component.by_priors ? nlohmann::ordered_json() : IdJson(file.graph, component.anchor)},
         {"nodes", component.nodes}});
  }
  json["down_weighted"] = nlohmann::ordered_json::array();
  for (std::size_t e : DownWeighted(report)) {
    const PoseGraphEdge& edge = file.graph.edges()[e];
    json["down_weighted"].push_back({{"from", IdJson(file.graph, edge.from)},
                                     {"to", IdJson(file.graph, edge.to)},
                                     {"chi2", report.edges[e].chi2},
                                     {"weight", report.edges[e].weight}});
  }
  if (certificate) {
    json["certificate"] = CertificateJson(*certificate);
    json["certificate"]["min_eigenvalue_bound"] = certificate->min_eigenvalue_bound;
    json["certificate"]["time_s"] = certificate->time_s;
  }
  json["warnings"] = file.warnings;
  return json;
}

void PrintCosts(const char* name, const GraphCosts& costs) {
  std::printf("  %-8s %16.9g %16.9g %16.9g\n", name, costs.chi2, costs.chi2log, costs.chordal);
}

void Print(const G2oFile& file, const PoseGraphReport& report) {
  std::printf("%zu poses in %s, %zu edges (%zu loops); start: %s; solver: %s\n", file.graph.nodes().size(),
              ToString(file.graph.kind()), file.graph.edges().size(), Loops(file.graph),
              ToString(report.start), ToString(report.solver));
  if (!file.graph.measurements().empty())
    std::printf("  %zu landmarks; %zu measurements of landmarks and priors\n", file.graph.landmarks().size(),
                file.graph.measurements().size());
  if (!report.solver_note.empty())
    std::printf("  (not the one that was asked for: %s)\n", report.solver_note.c_str());
  for (const StartOutcome& start : report.starts) {
    if (report.starts.size() < 2) break;
    std::printf("  from the %s: %.9g to %.9g%s%s\n", ToString(start.start), start.initial_objective,
                start.objective, start.spared ? ", downhill all the way" : "",
                start.start == report.start ? ", taken" : "");
  }
  std::printf("  %-8s %16s %16s %16s\n", "", "chi2", "chi2log", "chordal");
  PrintCosts("start", report.initial_costs);
  PrintCosts("result", report.costs);
  std::printf("  %s after %d iterations, %.3f s (of which initialisation %.3f s)\n",
              report.termination.c_str(), report.iterations, report.time_s, report.init_time_s);
  if (report.components.size() > 1) {
    std::printf("  the graph has %zu parts that no edge connects; each is held at one node:",
                report.components.size());
    for (std::size_t c = 0; c < report.components.size() && c < 10; ++c) {
      const GraphComponent& part = report.components[c];
      std::printf(" %s (%zu)", part.by_priors ? "its priors" : file.graph.NameOf(part.anchor).c_str(),
                  part.nodes);
    }
    std::printf(report.components.size() > 10 ? " ...\n" : "\n");
  }
  if (report.down_weighted == 0) return;
  std::printf("  %zu loops are rejected (weight < 0.5); the worst:\n", report.down_weighted);
  const std::vector<std::size_t> worst = DownWeighted(report);
  for (std::size_t k = 0; k < worst.size() && k < 10; ++k) {
    const PoseGraphEdge& edge = file.graph.edges()[worst[k]];
    const EdgeOutcome& outcome = report.edges[worst[k]];
    std::printf("    %s -> %s: chi2 %.1f, weight %.3f\n", file.graph.NameOf(edge.from).c_str(),
                file.graph.NameOf(edge.to).c_str(), outcome.chi2, outcome.weight);
  }
}

void Print(const Certificate& certificate) {
  if (!certificate.available) {
    std::printf("  no certificate: %s\n", certificate.reason.c_str());
    return;
  }
  std::printf("  chordal objective: local optimum %.9g, nothing is below %.9g (gap %.2g, %.3f s)\n",
              certificate.chordal, certificate.lower_bound, certificate.relative_gap, certificate.time_s);
  if (certificate.certified) std::printf("  certified global optimum of the chordal objective\n");
  if (!certificate.certified) std::printf("  not certified: %s\n", certificate.reason.c_str());
}

G2oFile ReadWithProgress(const OptimizeArguments& arguments) {
  Progress progress("reading", 0);
  return ReadG2o(arguments.in, arguments.bad_information, arguments.ignore_unknown,
                 [&](std::size_t lines) { progress.Say(std::to_string(lines) + " lines"); });
}

PoseGraphReport OptimizeWithProgress(const PoseGraphOptimizer& optimizer, PoseGraph& graph) {
  constexpr std::size_t kLarge = 2000000;       // edges
  constexpr std::size_t kPerGigabyte = 500000;  // in the plane; of 3D fewer
  Progress progress("solving", 0);
  const std::string size = std::to_string(graph.edges().size()) + " edges";
  if (graph.edges().size() >= kLarge) {
    progress.Note("solving " + size + ": this needs " + std::to_string(graph.edges().size() / kPerGigabyte) +
                  " GB of memory or more, and minutes before the first iteration; Ctrl-C ends it");
  }
  int iterations = 0;
  return optimizer.Optimize(graph, [&] {
    progress.Say(size + ", iteration " + std::to_string(++iterations));
    return false;
  });
}

void RunOptimize(const OptimizeArguments& arguments) {
  CheckFiles({arguments.in}, {arguments.out, arguments.json});
  const PoseGraphOptimizer optimizer(arguments.options);
  G2oFile file = ReadWithProgress(arguments);
  SayWarnings(file.warnings);
  if (arguments.options.init == GraphInit::kFile && !file.has_all_vertices) {
    throw InputError(arguments.in +
                     ": has edges to nodes without a vertex, so '--init file' has no start; use --init auto, "
                     "odometry or chordal");
  }
  const PoseGraphReport report = OptimizeWithProgress(optimizer, file.graph);
  std::optional<Certificate> certificate;
  if (arguments.certify && report.success)
    certificate = CertifyOptimum(file.graph, {}, report.chordal_optimum);
  if (!arguments.json.empty())
    internal::WriteFile(arguments.json, JsonText(ToJson(arguments, file, report, certificate)));
  if (!report.success) throw InputError(arguments.in + ": could not be optimised: " + report.reason);
  WriteG2o(arguments.out, file.graph);
  Print(file, report);
  if (certificate) Print(*certificate);
}

}  // namespace

void SetUpOptimize(CLI::App& command, int&) {
  const auto arguments = std::make_shared<OptimizeArguments>();
  command.add_option("IN", arguments->in, "Graph to read (.g2o)")->required();
  command.add_option("--out", arguments->out, "Where the optimised graph goes (.g2o)")->required();
  PoseGraphOptions& options = arguments->options;
  AddChoice(
      command, "--init", options.init, GraphInit::kAuto,
      "Start: file: the vertices; odometry: a spanning tree; chordal: linear relaxation, often near the "
      "global minimum where the others are not, and without --robust, if it leaves large residuals, the "
      "optimum of the chordal objective, too: the better result counts; auto: the one with the lowest cost");
  AddChoice(command, "--objective", options.objective, GraphObjective::kChi2,
            "chi2: g2o's error (vector part of the quaternion); chi2log: rotation vectors");
  AddChoice(
      command, "--robust", options.robust, RobustLoss::kNone,
      "Robust loss on loops: edges between poses whose ids do not follow each other among those of the "
      "file (of one robot, docs/backend.md). gnc: graduated non-convexity, then inlier or outlier; "
      "withstands the most false loops. dcs: weights down to 0; huber and cauchy: smaller weights; none: "
      "least squares");
  AddChoice(command, "--solver", options.solver, PoseGraphSolver::kBlock,
            "block: Levenberg-Marquardt with a Cholesky of the poses' blocks, the faster one; ceres: Ceres "
            "Solver, the same optimum");
  AddChoice(
      command, "--bad-information", arguments->bad_information, BadInformation::kRefuse,
      "Edges whose information matrix is not positive definite. refuse: the file, with their number; "
      "project: the nearest positive semidefinite matrix (negative eigenvalues become 0); diagonal: the "
      "positive entries of its diagonal; skip: without these edges, unless the graph falls apart then");
  command.add_flag("--ignore-unknown", arguments->ignore_unknown,
                   "Leave out lines whose tag tutti does not know, with a warning; without this the file is "
                   "refused");
  AddDefaulted(command, "--robust-chi2", options.robust_chi2,
               "Chi-square beyond which a loop is an outlier; 0: the 99 % quantile", NotNegative());
  AddDefaulted(command, "--max-iterations", options.max_iterations, "Levenberg-Marquardt iterations",
               Positive());
  command.add_flag(
      "--certify", arguments->certify,
      "Prove that the chordal objective has no lower value (as SE-Sync does), or say how far the "
      "proof falls short");
  command.add_option("--json", arguments->json,
                     "Write costs, time and what became of the loops to this file");
  command.footer(
      R"(Costs are sums over all edges without a robust loss and without the factor 1/2. Compare only costs of the same
column. A loop that is rejected keeps its place in the output file.
Example: tutti optimize graph.g2o --out optimised.g2o --robust gnc --json costs.json)");
  command.callback([arguments] {
    arguments->options.will_certify = arguments->certify;
    RunOptimize(*arguments);
  });
}

}  // namespace tutti::cli
