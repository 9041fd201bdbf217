// Output of `tutti loops`: results.json, hypotheses.csv, the pictures, the table on the terminal, and with
// --table every rule and every member on one image set, the paper's Table 1 for it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "apps/plot/plot.h"
#include "apps/run/output_folder.h"
#include "core/replaced_file.h"
#include "tutti/loopclosure/detector.h"
#include "tutti/loopclosure/evaluation.h"
#include "tutti/loopclosure/ground_truth.h"

namespace tutti::cli {

/// A loop into an image of an earlier run with the same memory (ltm_file, --places).
struct EarlierLoop {
  std::int64_t image = -1;  ///< its number in the memory
  std::string file;         ///< its path
};

/// What the detector has said about an image some images later (LateLoop).
enum class SecondWord { kNone, kAccepted, kWithdrawn };

/// One image's outcome.
struct LoopRow {
  std::string file;   ///< name of the image
  bool read = true;   ///< false: the file is damaged; the row stays in the denominator
  LoopResult result;  ///< with the decision that is final
  SecondWord second_word = SecondWord::kNone;  ///< what was decided later, and changed it
  std::optional<EarlierLoop>
      earlier;    ///< the loop is none of this run's, and `result` has it not as accepted
  double ms = 0;  ///< time of Detect [ms]

  /// The place that figures and pictures judge: the loop, or where there is none the filter's best; -1: none.
  long Said() const { return static_cast<long>(result.accepted ? result.candidate : result.best); }
};

/// Everything about one run.
struct LoopRun {
  LoopDetectorOptions options;
  std::string images;
  int stride = 1;
  LoopGroundTruth truth;  ///< of the rows; where there is none, every pair is ignored
  bool judged = true;     ///< there is a ground truth
  std::vector<LoopRow> rows;
  std::int64_t earlier = 0;                   ///< images of earlier runs that it went on from
  std::function<cv::Mat(std::size_t)> image;  ///< reads a row's (left) image again; empty: can't be read
  cv::Mat posterior;  ///< CV_32FC1, square: the posterior of past images (columns), by AddPosterior; may be
                      ///< empty

  /// Number of a row's image (or of a location) in every file: 0-based, among all images of the folder; -1
  /// stays.
  long Number(std::int64_t row) const { return row < 0 ? -1 : static_cast<long>(row) * stride; }
};

/// What the figures of every table are.
struct LoopReport {
  LoopEvaluation verified, ranked, posterior;
  double ms_median = 0, ms_p99 = 0;  ///< of Detect, over the images that could be read [ms]
  int damaged = 0;
};

LoopReport EvaluateRun(const LoopRun& run);

/// "loop", "ignored" or "none", in every file.
const char* LabelName(LoopLabel label);
/// "accepted", "withdrawn", or empty.
const char* SecondWordName(SecondWord word);

/// The figures of results.json, without the protocol.
nlohmann::ordered_json FiguresJson(const LoopRun& run, const LoopReport& report);

/// How they were measured, but for rule and members.
nlohmann::ordered_json ProtocolJson(const LoopRun& run);

/// What one run leaves in its folder, or a table of runs, each of which has a folder of its own in it.
OutputLayout LoopsLayout(bool table = false);

/// Writes all files of a run and puts them into place. Returns where. Throws InputError that names those that
/// can't be written.
std::filesystem::path WriteLoopRun(const LoopRun& run, const LoopReport& report, bool finished,
                                   OutputFolder& folder);

/// Prints the figures of one run.
void PrintLoopRun(const LoopRun& run, const LoopReport& report, const std::filesystem::path& folder);

// Pictures: colours that the colour-blind can tell apart (Okabe and Ito), and marks that differ in shape as
// well.
constexpr const char* kTrueColor = "#0072b2";    // blue
constexpr const char* kFalseColor = "#d55e00";   // vermilion
constexpr const char* kMissedColor = "#e69f00";  // orange

/// Adds one result's kept posterior to a picture of `images` x `images`, scaled down where that is too large.
void AddPosterior(const LoopResult& result, int images, cv::Mat& posterior);

/// The curves of precision over recall: precision_recall.csv, and the picture.
void WriteCurvesCsv(const LoopReport& report, const std::filesystem::path& file);
CurvePlot PlotCurves(const LoopRun& run, const LoopReport& report);

/// Ground truth by overlap: recall over the overlap and the angle of the earlier view that shares most.
void WriteRecallByViewCsv(const LoopReport& report, const std::filesystem::path& file);
CurvePlot PlotRecallByView(const LoopRun& run, const LoopReport& report);

/// Ground truth, posterior and what was said, side by side.
void WriteConfusion(const LoopRun& run, const LoopReport& report, const std::filesystem::path& file);

/// Every false positive and every missed loop, up to a stated number: the image, what was proposed, and what
/// the ground truth says. Reads the images again.
void WriteContactSheet(const LoopRun& run, const LoopReport& report, const std::filesystem::path& file);

/// "mean, 84 images of corridor, 44 with a loop", for titles.
std::string RunTitle(const LoopRun& run, const LoopReport& report);

/// One line of the table.
struct LoopTableRow {
  std::string rule;     ///< the word of --rule, and the name of its folder
  bool single = false;  ///< a member alone
  nlohmann::ordered_json figures;
  LoopReport report;
};

struct LoopTable {
  nlohmann::ordered_json protocol;
  std::vector<int> loop_images;  ///< the images that have a loop; the tests are over them
  std::vector<LoopTableRow> rows;
};

/// The words of --rule that the table runs: mean, product, majority, naive, and each member alone.
std::vector<std::string> TableRules(const LoopDetectorOptions& options);

/// Adds one rule's outcome, and what is common to all rules.
void AddToTable(const LoopRun& run, const LoopReport& report, LoopTable& table);

/// Prints the table and puts table.json, table.md and table.csv into place. Throws InputError if they can't
/// be written.
void WriteLoopTable(const LoopTable& table, OutputFolder& folder);

// What each candidate looked like to the detector, and what each member believed of each location, as files:
// for those who want to learn from it.

/// Writes dump_candidates.csv and dump_verification.csv (docs/outputs.md), image by image: all of a long walk
/// would not fit into memory. Needs results of a detector with LoopDetectorOptions::keep_evidence.
class LoopsDump {
 public:
  /// Opens both files in `folder` (made if missing) and writes their headers. Throws InputError if it can't.
  LoopsDump(const std::filesystem::path& folder, const std::vector<std::string>& members);
  /// Appends the lines of one image of the run; `truth` is for all its images.
  void Add(const LoopRun& run, const LoopResult& result, const LoopGroundTruth& truth);
  /// Appends what was decided later about an image: its verification, with `late` 1.
  void AddLate(const LoopRun& run, const LoopResult& result, const LoopGroundTruth& truth);
  /// To be called at the end: then the files are there. Throws InputError if the files could not be written
  /// in full.
  void Finish();

 private:
  internal::ReplacedFile candidates_file_, verification_file_;
  std::ofstream candidates_, verification_;
};

/// Writes `file`: "image,location,truth,combined,<member>..." for every pair that is a loop (truth 255; 128:
/// ignored, 0: none) or where one of the posteriors is at least 1e-4. Needs a run with
/// LoopDetectorOptions::keep_posterior. Throws InputError if it can't be written.
void WritePosteriors(const LoopRun& run, const std::filesystem::path& file);

}  // namespace tutti::cli
