// Every rule, every member and the seed's ensemble on one set of images, in one pass: features, words and
// verified pairs are the same for all rows, and made once. Of several changes of the same images, what lies
// before the first changed image is gone through once, too. bench/ensemble_protocol runs it and writes the
// tables.
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "apps/tutti/loops/loops_input.h"
#include "apps/tutti/loops/overlap_truth.h"
#include "bench/ensemble_row.h"
#include "core/camera_text.h"
#include "core/parallel.h"
#include "data/synthetic/image_change.h"
#include "loopclosure/features/whole_image.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"
#include "tutti/loopclosure/evaluation.h"

namespace tutti::bench {
namespace {

using Json = nlohmann::ordered_json;

struct Arguments {
  std::string images, twice, camera, said;
  cli::GroundTruthArguments truth;
  std::vector<std::string> changes;  // NAME:STRENGTH/SEED
  bool overlay = false;
  bool rgbd = false;
  int sift_features = 0;  // 0: as many as the others
  std::vector<std::string> rows = {"joint", "mean", "naive", "surf", "sift", "orb", "seed"};
  std::vector<std::string> members = {"surf", "sift", "orb"};
  bool posterior_only = false;
  int threads = 1;
};

// The senses: extracts and quantises once for all rows.
class Perception {
 public:
  Perception(const std::vector<std::string>& names, const Arguments& arguments) {
    options_.threads = arguments.threads;
    for (std::size_t k = 0; k < names.size(); ++k) {
      LoopDetectorOptions options = options_;
      if (names[k] == "sift" && arguments.sift_features > 0)
        options.extraction.features = arguments.sift_features;
      members_.emplace_back(BaseName(names[k]), options, options.seed * 1000003u + k);
    }
  }

  Percept See(const LoopQuery& query) {
    const auto begin = std::chrono::steady_clock::now();
    const cv::Mat grey = ToGrey8(query.image);
    std::vector<Features> features(members_.size());
    Percept percept;
    percept.words.resize(members_.size());
    RunParallel(static_cast<int>(members_.size()), options_.threads, [&](int i) {
      const std::size_t k = static_cast<std::size_t>(i);
      Member& member = members_[k];
      features[k] = member.Extract(query.image, grey, query.mask);
      if (!member.Judge(features[k])) return;
      if (member.dense()) {
        percept.words[k].descriptor = NormalisedDescriptor(features[k].descriptors);
        return;
      }
      percept.words[k].words = member.vocabulary().Quantise(features[k].descriptors);
      for (const cv::KeyPoint& keypoint : features[k].keypoints) {
        percept.words[k].cells.push_back(SeenWords::Cell(keypoint.pt, query.image.size()));
      }
      member.vocabulary().AddReferences(Signature(percept.words[k].words));
    });
    percept.view = MakeView(query, features, options_.verification);
    percept.ms = MillisecondsSince(begin);
    return percept;
  }

 private:
  LoopDetectorOptions options_;
  std::vector<Member> members_;
};

// A black rim, and at the bottom a part of the robot itself: the same in every image.
void Overlay(cv::Mat& image) {
  const int rim = std::max(2, image.rows / 25);
  const int part = image.rows / 6;
  cv::RNG random(7);
  for (int i = 0; i < 60; ++i) {
    const int height = random.uniform(4, 20), width = random.uniform(4, 30);
    const int y = image.rows - random.uniform(rim, part + rim), x = random.uniform(0, image.cols);
    const cv::Rect box(x, y, width, height);
    const int tone = random.uniform(0, 256);
    image(box & cv::Rect(0, image.rows - part, image.cols, part)) = cv::Scalar(tone, tone, tone, 255);
  }
  cv::rectangle(image, cv::Rect(0, 0, image.cols, image.rows), cv::Scalar::all(0), 2 * rim);
}

// All rows over one set of images.
class Study {
 public:
  explicit Study(const Arguments& arguments)
      : arguments_(arguments),
        set_(cli::LoadImageSet(arguments.images, arguments.truth, "", std::nullopt, arguments.rgbd)),
        names_(Names(arguments)),
        perception_(names_, arguments),
        pairs_(LoopDetectorOptions().verification) {
    if (!arguments.camera.empty()) camera_ = internal::ParseCamera(arguments.camera);
    if (set_.depth) camera_ = set_.depth->camera();
    rows_.reserve(arguments.rows.size());
    for (const std::string& row : arguments.rows)
      rows_.emplace_back(row, names_, arguments.posterior_only, set_.truth.size());
  }

  // What is said of each change, or of the images as they are.
  Json Run() {
    if (arguments_.changes.empty()) {
      GoTo(set_.images.size(), "");
      return Figures();
    }
    std::size_t begin = 0;
    while (begin < set_.images.size() && !set_.truth.HasLoop(static_cast<int>(begin))) ++begin;
    GoTo(begin, "");
    Json json = Json::object();
    for (const std::string& change : arguments_.changes) json[change] = Apart(change);
    return json;
  }

  const LoopGroundTruth& truth() const { return set_.truth; }

 private:
  static std::vector<std::string> Names(const Arguments& arguments) {
    std::vector<std::string> names = arguments.members;
    if (!arguments.twice.empty()) names.push_back(arguments.twice + "'");
    return names;
  }

  // Goes on in a process of its own, which leaves this one's state as it is.
  Json Apart(const std::string& change) {
    int ends[2];
    if (pipe(ends) != 0) throw InputError("no pipe can be made");
    const pid_t child = fork();
    if (child < 0) throw InputError("no process can be made");
    if (child == 0) {
      close(ends[0]);
      std::string text;
      int status = 0;
      try {
        GoTo(set_.images.size(), change);
        text = Figures().dump();
      } catch (const std::exception& e) {
        std::fprintf(stderr, "ensemble_rows: %s: %s\n", change.c_str(), e.what());
        status = 2;
      }
      for (std::size_t at = 0; at < text.size();) {
        const ssize_t written = write(ends[1], text.data() + at, text.size() - at);
        if (written <= 0) _exit(2);
        at += static_cast<std::size_t>(written);
      }
      _exit(status);
    }
    close(ends[1]);
    std::string text;
    char part[1 << 16];
    for (ssize_t got = 0; (got = read(ends[0], part, sizeof part)) > 0;)
      text.append(part, static_cast<std::size_t>(got));
    close(ends[0]);
    int status = 0;
    waitpid(child, &status, 0);
    if (status != 0) throw InputError(change + ": failed");
    return Json::parse(text);
  }

  LoopQuery Read(std::size_t i, const std::string& change) const {
    LoopQuery query;
    query.id = static_cast<std::int64_t>(i);
    const std::filesystem::path &left = set_.images[i], &right = set_.rights[i];
    if (arguments_.rgbd) {
      std::tie(query.image, query.depth_m) = set_.ReadWithDepth(i);
    } else {
      query.image = right.empty() ? set_.Read(i) : cli::ReadJoined(left, right, &query.cameras);
    }
    if (query.image.empty()) throw InputError(left.string() + ": can't be read");
    if (!change.empty()) {
      const std::size_t slash = change.find('/');
      const std::uint64_t seed =
          slash == std::string::npos ? 1 : std::strtoull(change.c_str() + slash + 1, nullptr, 10);
      query.image = ImageChange::Parse(change.substr(0, slash)).Apply(query.image, seed, static_cast<int>(i));
    }
    if (arguments_.overlay) Overlay(query.image);
    if (camera_ && (arguments_.rgbd || !arguments_.camera.empty())) {
      query.camera = camera_;
      query.camera->width = query.image.cols;
      query.camera->height = query.image.rows;
    }
    return query;
  }

  void GoTo(std::size_t end, const std::string& change) {
    for (std::size_t i = percepts_.size(); i < end; ++i) {
      percepts_.push_back(perception_.See(Read(i, change)));
      for (Row& row : rows_) row.Take(static_cast<std::int64_t>(i), percepts_, pairs_);
    }
  }

  Json Figures() const {
    Json json = Json::object();
    for (const Row& row : rows_) json[row.name()] = row.Figures(set_.truth);
    return json;
  }

  const Arguments& arguments_;
  cli::ImageSet set_;
  std::optional<PinholeCamera> camera_;
  std::vector<std::string> names_;
  Perception perception_;
  PairCache pairs_;
  std::vector<Row> rows_;
  std::vector<Percept> percepts_;
};

// Loops that `tutti loops` of any version has written, judged by this ground truth.
Json Judge(const Arguments& arguments) {
  const cli::ImageSet set = cli::LoadImageSet(arguments.images, arguments.truth);
  std::vector<LoopObservation> observations(set.images.size());
  for (std::size_t i = 0; i < observations.size(); ++i) observations[i].image = static_cast<int>(i);
  std::ifstream in(arguments.said);
  std::string line;
  if (!std::getline(in, line) || line.rfind("image,loop_with,probability,", 0) != 0)
    throw InputError(arguments.said + ": no loops.csv of tutti loops");
  while (std::getline(in, line)) {
    const std::vector<std::string> cells = SplitText(line, ",");
    const int stride = arguments.truth.stride;
    const std::size_t image = static_cast<std::size_t>(std::atoi(cells.at(0).c_str()) / stride);
    if (image >= observations.size()) throw InputError(arguments.said + ": is of other images");
    LoopObservation& o = observations[image];
    o.accepted = o.proposed = true;
    o.verified = std::atoi(cells.at(1).c_str()) / stride;
    o.probability = std::atof(cells.at(2).c_str());
  }
  return {{"said", FiguresOf(observations, set.truth, 0)}};
}

int Run(const Arguments& arguments) {
  cv::setNumThreads(arguments.threads);  // of a pool nothing is left in a forked process
  Json json = {{"rows", Json::object()}};
  if (!arguments.said.empty()) {
    json["rows"] = Judge(arguments);
  } else {
    Study study(arguments);
    json["ground_truth"] = study.truth().description;
    json[arguments.changes.empty() ? "rows" : "changes"] = study.Run();
  }
  std::printf("%s\n", json.dump().c_str());
  return 0;
}

}  // namespace
}  // namespace tutti::bench

int main(int argc, char** argv) {
  CLI::App app("Every row of the ensemble's protocol on one set of images, as JSON");
  tutti::bench::Arguments a;
  app.add_option("--images", a.images, "folder")->required();
  app.add_option("--ground-truth", a.truth.file, "loop matrix or trajectory")->required();
  app.add_option("--stride", a.truth.stride, "every n-th image");
  app.add_flag("--join-pairs", a.truth.join_pairs, "left and right images make one");
  app.add_option("--gt-distance", a.truth.rule.distance_m, "[m]");
  app.add_option("--gt-angle", a.truth.rule.angle_deg, "[deg]");
  app.add_option("--gt-ignore", a.truth.rule.ignore_m, "[m]");
  app.add_option("--gt-exclude-s", a.truth.rule.exclude_s, "[s]");
  app.add_option("--ground-truth-overlap", a.truth.overlap, "loops by overlap, as tutti loops has them");
  app.add_option("--gt-camera", a.truth.depth.camera, "of depth images");
  app.add_option("--camera", a.camera, "of the images: verify with the essential matrix");
  app.add_flag("--rgbd", a.rgbd, "depth goes to the detector");
  app.add_option(
         "--changes", a.changes,
         "NAME:STRENGTH/SEED, ...: each changes every image from the first one whose row has a loop on")
      ->delimiter(',');
  app.add_flag("--overlay", a.overlay, "a black rim and a part of the robot in every image");
  app.add_option("--twice", a.twice, "this member is there twice");
  app.add_option("--sift-features", a.sift_features, "SIFT finds no more");
  app.add_option(
         "--rows", a.rows,
         "which; joint:surf+orb: the rule over these members alone; joint/shuffle=surf: this member's "
         "counts are shuffled in every image; joint/false-links=20: so many are planted")
      ->delimiter(',');
  app.add_option("--members", a.members, "of the ensemble")->delimiter(',');
  app.add_flag("--posterior-only", a.posterior_only, "no geometry, and no links that come of it");
  app.add_option("--said", a.said, "judges a loops.csv of tutti loops instead");
  app.add_option("--threads", a.threads, "for extraction");
  CLI11_PARSE(app, argc, argv);
  try {
    return tutti::bench::Run(a);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "ensemble_rows: %s\n", e.what());
    return 2;
  }
}
