// What `tutti evaluate` and `tutti plot` have in common: a reference, estimates, and how they are compared.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "tutti/backend/evaluation.h"
#include "tutti/backend/trajectory_file.h"

namespace CLI {
class App;
}

namespace tutti::cli {

/// The command line's words.
struct EvaluationInput {
  std::vector<std::string> files;     ///< without an option before them
  bool reference_comes_first = true;  ///< the first of `files` is the reference, unless that has an option
  std::string reference;
  std::vector<std::string> estimates, names;  ///< names: of the estimates, for tables; empty: their files
  std::vector<std::string> runs;              ///< folders of `tutti run`
  std::string format = "auto", reference_format, times;     ///< reference_format: empty for that of `format`
  std::string frames;                                       ///< file with the stamps of all images
  std::string align;                                        ///< empty: se3, or the run's
  bool fit = false, fit_scale = false, fit_origin = false;  ///< evo's -a, -s, --align_origin
  std::string vertical = "z", rpe_unit = "frames", plane = "none";
  std::vector<double> motion_filter;                 ///< [m], [deg]; empty: none
  EvaluationOptions options;                         ///< without what the words above say
  std::map<std::string, std::string> run_names;      ///< of estimates that are runs'
  std::map<std::string, std::size_t> frames_of_run;  ///< of estimates that are runs': frames that there were
  std::string sensor;                                ///< of the runs; empty: unknown
};

/// Adds the files and everything about formats, association, alignment and relative errors.
void AddEvaluationOptions(CLI::App& command, EvaluationInput& input);

/// Files without option, runs and evo's words taken apart: `reference` (may be empty), `estimates`, `align`
/// and formats are set then. Throws InputError if there is no such run, or if runs differ.
EvaluationInput Resolved(EvaluationInput input);

/// All files that are read. `input`: resolved.
std::vector<std::string> FilesOf(const EvaluationInput& input);

/// Throws InputError that says how to call the command if there is no reference or no estimate. `input`:
/// resolved.
void RequireFiles(const EvaluationInput& input);

/// An estimate as its file has it.
struct NamedPoseFile {
  std::string name, file;
  PoseFile poses;
};
/// `input`: resolved. Warnings go to stderr. Throws InputError that names the file.
std::vector<NamedPoseFile> ReadEstimates(const EvaluationInput& input);

/// One estimate, measured.
struct EvaluatedEstimate {
  std::string name, file;
  EvaluationOptions options;  ///< that were used
  EvaluationReport report;
};

/// `input`: resolved. Reads all files (warnings go to stderr) and measures each estimate. KITTI against KITTI
/// without times is paired line by line. Throws InputError that names the files.
std::vector<EvaluatedEstimate> EvaluateInput(EvaluationInput input);

}  // namespace tutti::cli
