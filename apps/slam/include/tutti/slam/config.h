// The YAML configuration of a run: one file, sections dataset, camera, odometry, loops, graph, run.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "tutti/backend/pose_graph_optimizer.h"
#include "tutti/frontend/dataset.h"
#include "tutti/frontend/odometry_options.h"
#include "tutti/loopclosure/detector_options.h"
#include "tutti/slam/slam_options.h"

#pragma GCC visibility push(default)
namespace tutti {

/// Everything that a run can be told.
struct RunConfig {
  RunConfig();
  DatasetOptions dataset;     ///< sections `dataset:` and `camera:`
  OdometryOptions odometry;   ///< section `odometry:`
  LoopDetectorOptions loops;  ///< section `loops:`
  PoseGraphOptions graph;     ///< section `graph:`
  SlamOptions run;            ///< section `run:`
};

/// Reads a configuration; keys that the file leaves out keep their defaults. Where there is no such file, a
/// bare name is that of a configuration for a public data set that is part of tutti: "7scenes", "euroc_mono",
/// "data/configs/euroc_mono.yaml". Throws InputError that names
/// file and line for: missing file, YAML errors, unknown or repeated keys (with the nearest valid one), a
/// value of the wrong type, a value out of range.
RunConfig LoadConfig(const std::filesystem::path& file);

/// The same from a text; `name` stands for the file in messages.
RunConfig ParseConfig(const std::string& text, const std::string& name);

/// Sets options from texts `section.key=value` with the keys and values of the YAML file: "run.threads=1",
/// "loops.extraction.features=300". Later ones win. Throws InputError for an unknown key (with the nearest
/// valid one) and for a value of the wrong type or out of range; nothing is set then.
void SetOptions(const std::vector<std::string>& assignments, RunConfig& config);

/// The same for section `loops:` alone, whose name is left out: "stm_size=20", "rule=product".
void SetLoopOptions(const std::vector<std::string>& assignments, LoopDetectorOptions& options);

/// One key with its present value, for the echo in summary.json and for --help-config.
struct ConfigEntry {
  std::string section, name, value, doc;
  bool advanced = false;  ///< few users ever set it
};

/// All keys in the order of the sections.
std::vector<ConfigEntry> DescribeConfig(const RunConfig& config);

/// The keys that users set, or all of them, with units and defaults, as a commented YAML file. Comments are
/// wrapped to this many columns; 0: each in one line.
std::string HelpConfig(bool advanced, std::size_t columns = 0);

}  // namespace tutti
#pragma GCC visibility pop
